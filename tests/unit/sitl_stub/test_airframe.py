"""Airframe files: what they must hold and what the vehicles of the project are."""

from pathlib import Path

import pytest

from sitl_stub.airframe import AirframeError, read_airframe
from sitl_stub.autopilot.parameters import Parameters

FOLDER = Path(__file__).parents[3] / "configs" / "airframes"
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))


def test_all_vehicles_are_there() -> None:
    assert NAMES == ["falanga2017", "guo2025", "sih_quadx", "sih_quadx_lowdrag", "x500"]


@pytest.mark.parametrize("name", NAMES)
def test_hover_lies_well_inside_the_thrust_range_and_is_what_the_parameters_say(name: str) -> None:
    airframe = read_airframe(FOLDER / f"{name}.toml")
    assert 0.4 < airframe.hover_signal < 0.65
    assert Parameters(airframe.parameters).get("MPC_THR_HOVER") == pytest.approx(airframe.hover_signal, abs=0.02)


def test_recorded_vehicle_has_the_parameters_of_the_recorded_simulator() -> None:
    airframe, px4 = read_airframe(FOLDER / "sih_quadx.toml"), Parameters().as_mapping()
    assert airframe.mass_kg == px4["SIH_MASS"]
    assert airframe.inertia_kg_m2 == pytest.approx((px4["SIH_IXX"], px4["SIH_IYY"], px4["SIH_IZZ"]))
    assert airframe.rotors.max_thrust_n == px4["SIH_T_MAX"]
    assert airframe.rotors.max_torque_nm == pytest.approx(px4["SIH_Q_MAX"])
    assert airframe.rotors.time_constant_s == pytest.approx(px4["SIH_T_TAU"])
    assert airframe.drag.linear_n_s_m[0] == px4["SIH_KDV"]


def test_thrust_to_weight_of_the_papers() -> None:
    falanga = read_airframe(FOLDER / "falanga2017.toml")
    assert falanga.mass_kg == 1.0
    assert 4 * falanga.rotors.max_thrust_n / (falanga.mass_kg * 9.80665) == pytest.approx(1.85, abs=0.001)
    assert read_airframe(FOLDER / "guo2025.toml").mass_kg == 1.8


def test_hover_signal_honours_the_thrust_curve(tmp_path: Path) -> None:
    text = (FOLDER / "sih_quadx.toml").read_text(encoding="utf-8")
    path = tmp_path / "curved.toml"
    path.write_text(text.replace("[drag]", "thrust_curve = 0.4\n\n[drag]"), encoding="utf-8")
    u = read_airframe(path).hover_signal
    assert 20.0 * (0.6 * u + 0.4 * u * u) == pytest.approx(9.80665)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("mass_kg = 1.0 ", "mass_kg = -1.0 "), "mass_kg"),
        (("max_thrust_n", "max_trust_n"), "max_trust_n"),
        (("[rotors]", "[rotors"), "curved.toml"),
    ],
)
def test_a_bad_file_is_refused_with_its_name_and_key(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    text = (FOLDER / "sih_quadx.toml").read_text(encoding="utf-8")
    assert change[0] in text
    path = tmp_path / "curved.toml"
    path.write_text(text.replace(*change), encoding="utf-8")
    with pytest.raises(AirframeError, match=message):
        read_airframe(path)
