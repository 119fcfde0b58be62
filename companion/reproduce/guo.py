"""`guo`: quadrotor on a small boat (Guo et al., Drones 2025). Paths, ranging and flights, put together."""

from __future__ import annotations

from companion.reproduce.guo_flights import flight_rows
from companion.reproduce.guo_paths import (
    CRUISE_M_S,
    HEIGHTS_M,
    SPACING_M,
    TOP_SPEED_M_S,
    TURN_M_S2,
    path_rows,
    rotor_radius_m,
)
from companion.reproduce.guo_stereo import calibration_of_the_paper, stereo_rows
from companion.reproduce.guo_trigger import trigger_rows
from companion.reproduce.row import Reproduction
from companion.reproduce.watched_flight import preset

ERRATA = (
    "Tables 4 and 5 print the mean of the signed stereo errors as MAE: from the printed Table 3 it is 35.35 cm over all and "
    "4.78 cm under 5 m.",
    "No one calibration gives the stereo column of Table 3: it is right to 1 cm up to 3 m, 2.6 % short at 3.5 m and 7 % at 5 m, where a "
    "pair out of line is short in proportion to the distance. So with one that meets the whole table the part under 5 m is larger.",
    "Fig. 3 says that a larger T shrinks the deviation of minimum snap and then sharpens its corners. From rest to rest and "
    "with the time shared by distance the optimum is one shape at every T: scaling time scales the cost and nothing else. "
    "OSQP, tried on their programme as printed (relative time), finds that shape as well.",
    "A corridor of 3 m cannot have a mean deviation of 1.68 m in the plane (in space its corners are 2.1 m away). Read as 3 m to "
    "each side of points along the lines, as the inequalities at the waypoints in their text say, it has.",
    "The event trigger's 30 and 18 s are one landing each, by day and by night. Of the gains and delays that the text lets through, "
    "few give their law such a ratio (table of draws): as a rule it lands as fast without the trigger.",
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
        rows=(*paths, *ranging, *trigger_rows(quick), *flights),
        figures=(*path_charts, *ranging_charts, *flight_charts),
        errata=ERRATA,
        notes=_notes(config.cameras["front"].fx_px),
    )


def _notes(focal_px: float) -> tuple[str, ...]:
    seen = calibration_of_the_paper(focal_px)
    return (
        f"The 3-D version has the printed waypoints at heights of {', '.join(f'{h:g}' for h in HEIGHTS_M)} m.",
        f"Durations: the paper does not say how its vehicle followed the paths. The three by minimum snap have a time law, and are "
        f"sped up until their fastest instant has {TOP_SPEED_M_S:g} m/s, with which the improved method's path takes its printed "
        f"time. The Bézier's speed jumps at the waypoints: it is flown at up to {CRUISE_M_S:g} m/s, the mean speed of that flight, "
        f"and {TURN_M_S2:g} m/s2 (PX4's MPC_ACC_HOR). All at one even speed, the order would be that of the distances.",
        f"Corridor: points every {SPACING_M:g} m. The spacing is not printed and was taken for the printed mean deviation in 3-D; "
        "the orders are the printed ones from 2.5 to 4.5 m.",
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
        "than the paper's better one: position is controlled in north and east axes against the filtered pad, and turning costs "
        "nothing. Its own law (controller `guo`) steers by the marker's place in the picture, in which turning is sideways motion, "
        "and by a yaw from single pictures: at 5 m, nearly from the front, 0.3 px of noise in the corners are 7 degrees of yaw. The "
        "table of draws flies that in the plane.",
        "The paper stops the motors above the deck and drops; here the vehicle goes down at 8 cm/s and stops them on the deck.",
        "Cart, boat and comparisons wait 2.25 m behind the landing point (3 m from the marker) instead of 5 m.",
    )
