"""`guo`: quadrotor on a small boat (Guo et al., Drones 2025). Paths, ranging and flights, put together."""

from __future__ import annotations

from companion.reproduce.guo_flights import flight_rows
from companion.reproduce.guo_paths import CRUISE_M_S, HEIGHTS_M, TURN_M_S2, path_rows, rotor_radius_m
from companion.reproduce.guo_stereo import calibration_of_the_paper, stereo_rows
from companion.reproduce.row import Reproduction
from companion.reproduce.watched_flight import preset

ERRATA = (
    "Tables 4 and 5 print the mean of the signed stereo errors as MAE: from the printed Table 3 it is 35.35 cm over all and "
    "4.78 cm under 5 m.",
    "Fig. 3 says that a larger T shrinks the deviation of minimum snap and then sharpens its corners. From rest to rest and "
    "with the time shared by distance the optimum is one shape at every T: scaling time scales the cost and nothing else. "
    "Their solver works to an absolute accuracy while the cost falls with the seventh power of T, which may be the reason.",
    "A corridor of 3 m cannot have a mean deviation of 1.68 m in the plane (in space its corners are 2.1 m away); ours keeps "
    "within.",
    "The box's 50 cm of length and its 15 and 10 cm to front and rear do not add up: read as 25 cm along, 50 cm across.",
)


def reproduce(quick: bool) -> Reproduction:
    """Quick: paths, few stereo pairs, one flight. Full: about two minutes."""
    config = preset("guo")
    paths, path_charts, _ = path_rows(quick)
    ranging, ranging_charts = stereo_rows(config, quick)
    flights, flight_charts = flight_rows(quick)
    return Reproduction(
        key="guo",
        title="Guo et al. 2025: a visual guidance and control method for landing on a small boat",
        rows=(*paths, *ranging, *flights),
        figures=(*path_charts, *ranging_charts, *flight_charts),
        errata=ERRATA,
        notes=_notes(config.cameras["front"].fx_px),
    )


def _notes(focal_px: float) -> tuple[str, ...]:
    seen = calibration_of_the_paper(focal_px)
    return (
        f"The 3-D version has the printed waypoints at heights of {', '.join(f'{h:g}' for h in HEIGHTS_M)} m.",
        f"Durations: each path is flown at up to {CRUISE_M_S:g} m/s and {TURN_M_S2:g} m/s2 (the speed with which the improved "
        "method's path takes its printed time, and PX4's MPC_ACC_HOR). Of the three that pass every waypoint the order is the "
        "printed one. The corridor's path cuts the corners and is the shortest, here and in the paper; with any such rule it "
        "is then the quickest. That it takes longer in the paper comes from a path that cannot be ours: its mean deviation is "
        "larger than its corridor (errata).",
        f"Power: 1.8 kg, and the rotor radius ({100.0 * rotor_radius_m():.1f} cm) that gives the printed 312.6 W, since the "
        "paper prints no constants; its energies are its durations times that.",
        "Generation times are of this machine and a closed form (the corridor: an interior-point solver); the paper solves "
        "all by OSQP.",
        f"Stereo: baseline 50 mm (not printed). Table 3 shows a PnP that reads {100.0 * (seen.marker_scale - 1.0):.1f} % long "
        f"and a pair {seen.out_of_line_px:.2f} px out of line; rendered with these two the crossover is there. With a perfect "
        "calibration PnP is as good as stereo at every distance: the product takes whichever expects the smaller variance.",
        "The signs of the distortion are lost in the text; taken as +k1 -k2 +p1 +p2 +k3. The flights use the detector "
        "`stereo` on a frame of two pictures with a perfect calibration.",
        "Event trigger: 'without' is the yaw law `pad`, which corrects the whole way in. Both land equally fast here, and faster "
        "than the paper's better one. Its law steers by the marker's place in the picture (body frame, rotated by the yaw that "
        "is asked for), so that at 3 m each degree of yaw is 5 cm of sideways error; here position is controlled in north and "
        "east axes against the filtered pad, and turning costs nothing.",
        "The paper stops the motors above the deck and drops; here the vehicle goes down at 8 cm/s and stops them on the deck.",
        "Cart, boat and comparisons wait 2.25 m behind the landing point (3 m from the marker) instead of 5 m.",
    )
