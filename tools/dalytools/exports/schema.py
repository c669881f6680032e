# SPDX-License-Identifier: GPL-2.0-or-later
"""The columns of a table of records: name, type, unit, and the field that each is (docs/exports.md).

A column is named for its field and unit: ``daly.pack.voltage`` is ``pack_voltage_V``. What a record does not have is
null, never 0. What is sent as a number that stands for a word is that word; a number without a word stays, as text.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from dalytools.field_names import FIELD_NAMES
from dalytools.no_sensor import NO_SENSOR

if TYPE_CHECKING:
    from collections.abc import Mapping
    from collections.abc import Set as AbstractSet

    from dalyref.values import Value

Type: TypeAlias = Literal["bool", "int32", "int64", "double", "text", "time"]
"""``time``: nanoseconds since 1970 UTC here, microseconds (rounded down) in Parquet. Bytes are text: lower-case hex."""

PREFIX: Final = "daly."


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One quantity."""

    name: str
    type: Type
    unit: str = ""
    field: str = ""
    """As the dissector names it; empty of what is no field: file, number, time, interface, comment, connection."""
    several: bool = False
    """A list: the field may occur more than once in a record."""
    words: Mapping[int, str] | None = None
    """What the numbers of an enumeration mean; its type is text."""
    nothing: frozenset[int] = frozenset()
    """Values that stand for no value (field notes a.92: no sensor)."""
    hexadecimal: bool = False
    """People read it in hexadecimal: CSV writes it so."""
    of_battery: bool = False
    """It tells of the battery, not of the record that told it."""

    def names(self) -> tuple[str, ...]:
        """Return the names that people have for it: its own, and its field's, with and without ``daly.``."""
        return (self.name, self.field, self.field.removeprefix(PREFIX)) if self.field else (self.name,)

    @property
    def as_sent(self) -> bool:
        """Tell whether the value of a field stands in the table as it is."""
        return bool(self.field) and not (self.several or self.words or self.nothing)

    def value(self, sent: Value) -> Value | None:
        """Return what stands in the table for one value of a record's field."""
        if self.words or self.nothing:
            if not isinstance(sent, int):
                return None if self.nothing else str(sent)
            if sent in self.nothing:
                return None
            if self.words:
                return self.words.get(sent) or str(sent)
        return sent

    def values(self, sent: Value | list[Value]) -> Value | list[Value | None] | None:
        """Return what stands in the table for a record's field: a list where `several`."""
        if self.several:
            return [self.value(one) for one in (sent if isinstance(sent, list) else (sent,))]
        return self.value(sent[-1] if isinstance(sent, list) else sent)


def _words(text: str) -> AbstractSet[str]:
    return frozenset(text.split())


_NUMBERED = " ".join(f"cell.{number:02d}" for number in range(1, 49))

_TYPES: Final[tuple[tuple[Type, str, str], ...]] = (
    (
        "double",
        "V",
        """
        pack.voltage pack.gather_voltage setting.pack_high_1 setting.pack_high_2 setting.pack_low_1
        setting.pack_low_2
        """,
    ),
    (
        "double",
        "A",
        """
        pack.current setting.current_drift setting.charge_current_1 setting.charge_current_2
        setting.discharge_current_1 setting.discharge_current_2 alarm.discharge alarm.charge limit.current
        """,
    ),
    (
        "double",
        "%",
        "soc setting.soc_high_1 setting.soc_high_2 setting.soc_low_1 setting.soc_low_2 setting.soc limit.duty",
    ),
    ("double", "s", "response_time alarm.delay alarm.recovery_delay alarm.discharge_delay alarm.charge_delay"),
    ("double", "mV", "cells.average"),
    ("double", "C", "sensors.average"),
    ("double", "km", "mileage"),
    ("double", "", "alarm.value alarm.recovery"),  # mV, V or C, by alarm.class
    (
        "int32",
        "mV",
        f"""
        cell.max_voltage cell.min_voltage cell.voltage cells.voltage cells.min cells.max cells.spread {_NUMBERED}
        setting.cell_high_1 setting.cell_high_2 setting.cell_low_1 setting.cell_low_2 setting.cell_difference_1
        setting.cell_difference_2 setting.balance_start setting.balance_difference cell.average_voltage cell.difference
        """,
    ),
    (
        "int32",
        "C",
        """
        temperature.max temperature.min temperature sensors.temperature sensors.min sensors.max sensors.spread
        setting.charge_temp_high_1 setting.charge_temp_high_2 setting.charge_temp_low_1 setting.charge_temp_low_2
        setting.discharge_temp_high_1 setting.discharge_temp_high_2 setting.discharge_temp_low_1
        setting.discharge_temp_low_2 setting.temp_difference_1 setting.temp_difference_2 setting.mos_temp_high
        setting.heater_start setting.fan_start temperature.difference temperature.mos temperature.board
        temperature.heater
        """,
    ),
    ("int64", "s", "setting.sleep uptime.total uptime.since_start"),
    ("int32", "min", "time_to_full"),
    ("int32", "%", "soh"),
    ("int32", "A", "setting.short_circuit_current heater.current"),
    ("int32", "mA", "balance.current setting.balance_current"),
    ("int32", "W", "power"),
    ("int32", "Wh", "energy"),
    ("int64", "mV", "setting.cell_nominal_voltage"),
    ("int64", "mAh", "remaining_capacity setting.rated_capacity"),
    ("int64", "Ah", "total.charged total.discharged"),
    ("int64", "", "request_in reply_in late_to reassembled_in changed_from contradicts balance.mask"),
    (
        "bool",
        "",
        """
        unknown_id retry unanswered unasked other_board second_host write mos.charge mos.discharge mos.precharge
        di1 di2 di3 di4 do1 do2 do3 do4 burst.repeat burst.cut_off setting.balancer setting.mos_charge
        setting.mos_discharge balance.active wakeup.key wakeup.button wakeup.rs485 wakeup.can wakeup.current heater fan
        limit.active
        modbus.ambiguous modbus.assumed can.remote
        """,
    ),
    (
        "text",
        "",
        """
        kind transport dialect data write_result text_part manufacturer battery_name battery_code software_version
        hardware_version serial_number fault_raised fault_cleared changed contradiction production_date firmware_index
        clock command password alarm.class software_version_sent hardware_version_sent reserved undecoded foreign
        """,
    ),
)
"""(type, unit, fields). All others are of type int32, without a unit; every ``daly.fault.`` is of type bool."""

_WORDS: Final[tuple[tuple[str, Mapping[int, str]], ...]] = (
    ("direction", {1: "request", 2: "reply", 3: "echo"}),
    ("checksum.status modbus.crc.status", {0: "bad", 1: "good", 2: "unverified"}),
    ("state pack.state", {0: "stationary", 1: "charging", 2: "discharging"}),
    ("charger load", {0: "disconnected", 1: "connected"}),
    ("setting.battery_type", {0: "LFP", 1: "ternary", 2: "LTO"}),
    ("setting.operating_mode", {1: "long press", 2: "short press"}),
    (
        "setting.inverter",
        dict(enumerate(("none", "Pylon", "Growatt", "Sofar", "Voltronic", "GoodWe", "SRNE", "MUST", "Victron"))),
    ),
    ("setting.inverter_bus", {0: "RS485", 1: "CAN"}),
)
_SEVERAL: Final = _words(
    """
    cell.voltage cells.voltage temperature sensors.temperature burst.missing balance.cell fault_raised
    fault_cleared changed contradiction contradicts command modbus.value modbus.absent
    """
)
_NO_SENSOR: Final = _words(
    """
    temperature.max temperature.min temperature sensors.temperature
    """
)
_HEXADECIMAL: Final = _words(
    """
    start address data_id data checksum reserved undecoded balance.mask setting.key_logic modbus.address
    modbus.function modbus.register modbus.value modbus.absent modbus.crc can.priority can.destination can.source
    can.register
    """
)
_OF_THE_RECORD: Final = _words(
    """
    kind transport dialect start address data_id unknown_id length data checksum checksum.status direction board
    retry request_in reply_in response_time unanswered unasked late_to other_board second_host write write_result
    frame_number cell.voltage temperature burst.missing burst.repeat burst.cut_off reassembled_in text_part
    changed changed_from contradiction contradicts can.priority can.destination can.source can.register can.remote
    reserved undecoded foreign
    """
)
"""Also the parts of a burst, whose whole is ``cells.voltage``, ``sensors.temperature``, ``battery_code`` ..."""


def _columns() -> tuple[Column, ...]:
    types: dict[str, tuple[Type, str]] = {name: (kind, unit) for kind, unit, names in _TYPES for name in names.split()}
    words = {name: meaning for names, meaning in _WORDS for name in names.split()}
    made: list[Column] = []
    for full in FIELD_NAMES:
        name = full.removeprefix(PREFIX)
        other: Type = "bool" if name.startswith("fault.") else "int32"
        kind, unit = types.get(name, (other, ""))
        made.append(
            Column(
                name="_".join((name.replace(".", "_"), *([unit.replace("%", "percent")] if unit else []))),
                type="text" if name in words else kind,
                unit=unit,
                field=full,
                several=name in _SEVERAL,
                words=words.get(name),
                nothing=NO_SENSOR if name in _NO_SENSOR else frozenset(),
                hexadecimal=name in _HEXADECIMAL,
                of_battery=name not in _OF_THE_RECORD and not name.startswith("modbus."),
            )
        )
    return tuple(made)


FILE: Final = Column("file", "text")
"""The capture, as it was named to the command."""
NUMBER: Final = Column("number", "int64")
"""Of the packet in which the record ends, as Wireshark counts."""
TIME: Final = Column("time_UTC", "time", "UTC")
"""When the record's first byte began on the wire."""
INTERFACE: Final = Column("interface", "int32")
"""Of the capture, from 0."""
COMMENT: Final = Column("comment", "text")
"""The packet's comment: of an event, what happened."""
CONNECTION: Final = Column("connection", "text")
"""Of Bluetooth and TCP: which; each is a bus of its own."""

FIELDS: Final = _columns()
"""A column a field, in the order of ``field_names``."""
RECORD_COLUMNS: Final = (
    FILE,
    NUMBER,
    TIME,
    INTERFACE,
    *(column for column in FIELDS if not column.field.removeprefix("daly.cell.").isdecimal()),
    COMMENT,
    CONNECTION,
)
"""A row a record. Single cells stand in the list ``cells_voltage_mV``."""
