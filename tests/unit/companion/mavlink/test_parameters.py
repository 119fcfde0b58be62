"""Parameters by name: bit-packed integers, lost answers, names that do not exist."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.mavlink.parameters import ParameterReader, decoded

MS = 1_000_000


def value_of(name: str, bits: bytes, kind: int) -> mav.MAVLink_param_value_message:
    return mav.MAVLink_param_value_message(name.encode(), struct.unpack("<f", bits)[0], kind, 887, 12)


@pytest.mark.parametrize(
    ("bits", "kind", "value"),
    [
        (struct.pack("<f", 12.0), 9, 12.0),
        (struct.pack("<i", 1), 6, 1),
        (struct.pack("<i", -5), 6, -5),
        (struct.pack("<I", 4_000_000_000), 5, 4_000_000_000),
        (struct.pack("<b3x", -3), 2, -3),
    ],
)
def test_integers_come_bit_by_bit(bits: bytes, kind: int, value: float) -> None:
    assert decoded(struct.unpack("<f", bits)[0], kind) == value


def test_parameters_are_asked_a_few_at_a_time_and_read(connected: Any) -> None:
    names = ["MPC_XY_VEL_MAX", "COM_OF_LOSS_T", "COM_OBL_RC_ACT", "LNDMC_Z_VEL_MAX", "COM_DISARM_LAND"]
    connected.session.parameters.want(names)
    connected.advance(0)
    asked = connected.of_type("PARAM_REQUEST_READ")
    assert [m.param_id for m in asked] == names[:4]
    assert {m.param_index for m in asked} == {-1}
    connected.deliver(value_of("MPC_XY_VEL_MAX", struct.pack("<f", 12.0), 9))
    connected.deliver(value_of("COM_OBL_RC_ACT", struct.pack("<i", 3), 6))
    connected.advance(0)
    assert connected.of_type("PARAM_REQUEST_READ")[-1].param_id == "COM_DISARM_LAND"
    assert connected.session.parameters.values == {"MPC_XY_VEL_MAX": 12.0, "COM_OBL_RC_ACT": 3}


def test_a_name_that_does_not_exist_is_missing_after_the_last_attempt(connected: Any) -> None:
    connected.session.parameters.want(["NO_SUCH_THING"])
    for _ in range(40):
        connected.advance(100)
        connected.heartbeat()
    assert len(connected.of_type("PARAM_REQUEST_READ")) == 5
    assert connected.session.parameters.missing == {"NO_SUCH_THING"}
    assert connected.session.parameters.complete


def test_a_name_that_cannot_be_one_is_an_error() -> None:
    reader = ParameterReader(target_system=1, target_component=1, timeout_ns=MS, attempts=1)
    with pytest.raises(ValueError, match="1 to 16"):
        reader.want(["A_NAME_THAT_IS_TOO_LONG"])
