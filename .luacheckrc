-- SPDX-License-Identifier: GPL-2.0-or-later
-- luacheck's view of the Lua files: one dialect that 5.2 (Wireshark up to 4.2) and 5.4 (from 4.4 on) both run.
std = "lua52"
max_line_length = 120

-- In 5.2 but gone, or a build option, in 5.4; `bit` is what every Wireshark has.
not_globals = { "bit32", "unpack", "loadstring", "module", "setfenv", "getfenv", "math.pow", "table.getn" }

-- What Wireshark puts into the global environment (its reference manual's chapter on Lua).
files["dissector"] = {
  read_globals = {
    -- dissecting
    "Proto", "ProtoField", "ProtoExpert", "Dissector", "DissectorTable", "Pref", "Prefs", "Field", "FieldInfo",
    "Tvb", "TvbRange", "ByteArray", "Column", "Columns", "Pinfo", "TreeItem", "Address", "Int64", "UInt64", "NSTime",
    "heuristics_table", "all_field_infos",
    -- constants
    "base", "ftypes", "expert", "wtap", "wtap_encaps", "wtap_filetypes", "wtap_presence_flags", "wtap_rec_types", "wtap_tsprecs",
    "frametype", "PI_CHECKSUM", "PI_DEBUG", "PI_ERROR", "PI_MALFORMED", "PI_NOTE", "PI_PROTOCOL", "PI_REASSEMBLE",
    "PI_RESPONSE_CODE", "PI_SEQUENCE", "PI_UNDECODED", "PI_WARN", "MENU_ANALYZE_UNSORTED", "MENU_PACKET_ANALYZE_UNSORTED",
    "MENU_STAT_GENERIC", "MENU_STAT_UNSORTED", "MENU_TOOLS_UNSORTED", "ENC_BIG_ENDIAN", "ENC_LITTLE_ENDIAN",
    "ENC_ASCII", "ENC_UTF_8",
    -- listening, statistics, windows
    "Listener", "TextWindow", "ProgDlg", "register_menu", "register_stat_cmd_arg", "register_packet_menu", "gui_enabled",
    "new_dialog", "retap_packets", "copy_to_clipboard", "set_filter", "apply_filter", "get_filter", "reload_packets",
    "open_capture_file", "browser_open_url", "report_failure",
    -- files
    "Dumper", "PseudoHeader", "FileHandler", "File", "FrameInfo", "FrameInfoConst", "CaptureInfo", "CaptureInfoConst",
    "register_filehandler", "deregister_filehandler", "Dir", "Struct",
    -- the program
    "get_version", "set_plugin_info", "register_postdissector", "datafile_path", "persconffile_path",
    "running_superuser", "critical", "warn", "message", "info", "bit", "rex_pcre2", "GcryptCipher", "Conversation",
  },
}
files["tests"] = files["dissector"]

-- Tables of facts, one field a line.
for _, name in ipairs({ "fields", "fields_settings", "fields_wires" }) do
  files["dissector/daly_" .. name .. ".lua"] = { max_line_length = false }
end
