"""One named pure predicate per event of the mission: the reason as text where it holds, else None."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from companion.config import Mission, Safety
from companion.messages import AutopilotMode, LandedState, OperatorAction, Phase
from companion.mission.contact import window_is_closed
from companion.mission.facts import Facts
from companion.mission.phases import OFFBOARD_PHASES, Event
from companion.mission.preflight import blocking, is_flying
from companion.mission.waiting_place import waiting_place_m


@dataclass(frozen=True, slots=True)
class Context:
    """What the machine remembers between ticks, as far as guards may see it."""

    phase: Phase
    phase_age_s: float
    flight_age_s: float
    above_pad_for_s: float
    go_arounds: int
    stable_sight_for_s: float
    mission: Mission
    safety: Safety
    mode_at_entry: AutopilotMode | None = None
    holds_for_sight: bool = False


Guard = Callable[[Facts, Context], str | None]


def disarmed(facts: Facts, context: Context) -> str | None:
    if facts.status is None or facts.status.armed:
        return None
    if context.phase is Phase.TOUCHDOWN:
        return "motors are off on the pad"
    return "the vehicle is disarmed"


MODES_ON_THE_WAY: dict[Phase, frozenset[AutopilotMode]] = {
    Phase.TAKEOFF: frozenset({AutopilotMode.TAKEOFF, AutopilotMode.HOLD}),
    Phase.ENGAGE: frozenset({AutopilotMode.OFFBOARD}),
    Phase.HOLD: frozenset({AutopilotMode.HOLD}),
    Phase.RETURN: frozenset({AutopilotMode.RETURN, AutopilotMode.LAND}),
}
"""While a mode is being asked for, the one found at the phase's beginning is no pilot's answer either."""


def _left_our_modes(facts: Facts, context: Context) -> bool:
    if facts.status is None:
        return False
    asked = MODES_ON_THE_WAY.get(context.phase)
    if asked is not None:
        return facts.status.mode not in asked and facts.status.mode is not context.mode_at_entry
    return context.phase in OFFBOARD_PHASES and facts.status.mode is not AutopilotMode.OFFBOARD


def pilot_took_over(facts: Facts, context: Context) -> str | None:
    if facts.status is None or not _left_our_modes(facts, context) or facts.status.failsafe:
        return None
    return f"mode {facts.status.mode}, not asked for by Companion"


def autopilot_failsafe(facts: Facts, context: Context) -> str | None:
    if facts.status is None or not _left_our_modes(facts, context) or not facts.status.failsafe:
        return None
    return f"the autopilot's failsafe took over in mode {facts.status.mode}"


def link_lost(facts: Facts, context: Context) -> str | None:
    if facts.status is not None and not facts.status.connected:
        return f"no heartbeat for {facts.status.link_age_s:.1f} s"
    return None


def stalled(facts: Facts, context: Context) -> str | None:
    """Silence this long makes the autopilot act by itself: what it then does must not be undone by our next setpoint."""
    limit = context.safety.stall_silence_s
    ages = {
        "the vehicle's state": facts.state_age_s,
        "the autopilot's mode": facts.mode_age_s,
        "Companion's own tick": facts.tick_gap_s,
    }
    return next((f"{name} is {age:.1f} s old" for name, age in ages.items() if age is not None and age > limit), None)


def _operator(action: OperatorAction) -> Guard:
    def guard(facts: Facts, context: Context) -> str | None:
        return f"operator: {action}" if facts.operator is action else None

    return guard


def _may_start(facts: Facts, context: Context) -> bool:
    return facts.operator is OperatorAction.START and not blocking(facts, context.safety)


def start_in_air(facts: Facts, context: Context) -> str | None:
    return "operator: start, vehicle is flying" if _may_start(facts, context) and is_flying(facts) else None


def start_on_ground(facts: Facts, context: Context) -> str | None:
    return "operator: start, vehicle is on the ground" if _may_start(facts, context) and not is_flying(facts) else None


def outside_fence(facts: Facts, context: Context) -> str | None:
    if facts.distance_from_start_m > context.safety.geofence_radius_m:
        return f"{facts.distance_from_start_m:.0f} m from the start, fence {context.safety.geofence_radius_m:.0f} m"
    if facts.height_above_start_m > context.safety.ceiling_m:
        return f"{facts.height_above_start_m:.0f} m above the start, ceiling {context.safety.ceiling_m:.0f} m"
    return None if facts.no_fly_zone is None else f"at the no-fly zone {facts.no_fly_zone}"


def battery_low(facts: Facts, context: Context) -> str | None:
    battery = None if facts.status is None else facts.status.battery_fraction
    if battery is None or battery >= context.safety.min_battery:
        return None
    return f"battery {battery:.0%}, reserve {context.safety.min_battery:.0%}"


def flight_too_long(facts: Facts, context: Context) -> str | None:
    if context.flight_age_s < context.safety.max_flight_time_s:
        return None
    return f"{context.flight_age_s:.0f} s since the start"


def request_refused(facts: Facts, context: Context) -> str | None:
    return facts.refused


def airborne(facts: Facts, context: Context) -> str | None:
    status = facts.status
    if status is None or not status.armed or status.mode is not AutopilotMode.HOLD or context.phase_age_s < 1.0:
        return None
    in_air = status.landed_state is LandedState.IN_AIR and facts.height_above_start_m > 1.0
    return f"{facts.height_above_start_m:.1f} m above the start" if in_air else None


def offboard_granted(facts: Facts, context: Context) -> str | None:
    granted = facts.status is not None and facts.status.mode is AutopilotMode.OFFBOARD
    return "the autopilot flies our setpoints" if granted else None


def no_landing_here(facts: Facts, context: Context) -> str | None:
    """The pad will be in a no-land zone at contact; or below there is water and the deck is not surely under the feet."""
    if facts.no_land_zone is not None:
        return f"the pad is in the no-land zone {facts.no_land_zone}"
    height, miss, mission = facts.height_above_pad_m, facts.miss_m, context.mission
    low = height is not None and height < mission.commit_height_m
    if not context.safety.only_the_pad_is_land or not low or miss is None:
        return None
    if miss > facts.half_deck_m:
        return f"{miss:.2f} m off the pad's centre over water"
    age = sight_age_s(facts, context.mission)
    return f"pad not seen for {age:.1f} s over water" if age > mission.vision_lost_descend_s else None


def touchdown_suspected(facts: Facts, context: Context) -> str | None:
    return "the vehicle no longer sinks at the deck's height" if facts.touchdown.suspected else None


def touchdown_lost(facts: Facts, context: Context) -> str | None:
    return "the vehicle is clear of the deck again" if facts.touchdown.airborne else None


def too_many_go_arounds(facts: Facts, context: Context) -> str | None:
    if context.go_arounds <= context.mission.max_go_arounds:
        return None
    return f"{context.go_arounds} go-arounds, at most {context.mission.max_go_arounds}"


BLIND_BELOW_M = 2.0
"""From higher up nothing is landed on that is not seen: who covers the markers may stand on the pad."""

SURE_SIGMAS = 2.0
"""Of the pad's place along the axis that is worse known: with so much added the predicted miss must still lie on the deck."""


def off_the_deck_unseen(facts: Facts, mission: Mission) -> str | None:
    """Out of sight for longer than `vision_hold_s`, all feet must meet the deck even where the estimate errs as it says it may."""
    age, then, height = sight_age_s(facts, mission), facts.contact, facts.height_above_pad_m
    if age <= mission.vision_hold_s:
        return None
    if facts.pad is None or then is None or facts.miss_m is None or height is None or height > BLIND_BELOW_M:
        return f"pad not seen for {age:.1f} s"
    covariance = facts.pad.covariance
    spread_m = SURE_SIGMAS * math.sqrt(max(covariance[0][0], covariance[1][1]))
    off_m, allowed_m = max(facts.miss_m, then.miss_m), facts.half_deck_m - mission.vehicle_foot_radius_m
    if off_m + spread_m <= allowed_m:
        return None
    return f"pad not seen for {age:.1f} s, {off_m:.2f} m off and {spread_m:.2f} m unsure, {allowed_m:.2f} m allowed"


def commit_unsafe(facts: Facts, context: Context) -> str | None:
    height, miss, speed = facts.height_above_pad_m, facts.miss_m, facts.relative_speed_m_s
    if height is None or miss is None or speed is None:
        return "the pad is not known any more"
    mission = context.mission
    if miss > 1.5 * mission.commit_miss_m:
        return f"{miss:.2f} m off the pad's centre"
    if speed > 2.0 * mission.commit_relative_speed_m_s:
        return f"{speed:.2f} m/s against the pad"
    if facts.contact is not None and math.degrees(facts.contact.deck_tilt_rad) > 2.0 * mission.commit_deck_tilt_deg:
        return f"the deck will tilt {math.degrees(facts.contact.deck_tilt_rad):.0f} deg"
    if context.phase_age_s > mission.max_commit_s:
        return f"no contact within {mission.max_commit_s:.0f} s"
    if height <= mission.blind_height_m:
        return None
    age = sight_age_s(facts, mission)
    if age > mission.vision_lost_descend_s:
        return f"pad not seen for {age:.1f} s at {height:.1f} m"
    return off_the_deck_unseen(facts, mission)


def outside_cone(facts: Facts, context: Context) -> str | None:
    height, miss = facts.height_above_pad_m, facts.miss_m
    if height is None or miss is None:
        return "the pad is not known any more"
    allowed = 2.0 * (context.mission.cone_radius_m + context.mission.cone_slope * height) + 0.5
    return f"{miss:.2f} m off at {height:.1f} m, {allowed:.2f} m allowed" if miss > allowed else None


def no_plan(facts: Facts, context: Context) -> str | None:
    return facts.no_plan_reason


def waits_for_straight(facts: Facts, mission: Mission, *, waited_s: float) -> bool:
    """Touched in a hard turn the vehicle leans, slides and may tip: it waits for a straighter part, but not for ever."""
    return facts.pad_is_bent and waited_s < mission.straight_wait_s


def ready_to_commit(facts: Facts, context: Context) -> str | None:
    height, miss, speed = facts.height_above_pad_m, facts.miss_m, facts.relative_speed_m_s
    mission = context.mission
    if height is None or miss is None or speed is None or height > mission.commit_height_m:
        return None
    tilt_deg = math.degrees(facts.tilt_rad)
    then = facts.contact
    fits = (
        max(miss, 0.0 if then is None else then.miss_m) <= mission.commit_miss_m
        and speed <= mission.commit_relative_speed_m_s
        and tilt_deg <= mission.commit_tilt_deg
        and window_is_closed(then, mission) is None
        and off_the_deck_unseen(facts, mission) is None
        and not waits_for_straight(facts, mission, waited_s=context.phase_age_s)
    )
    return f"{miss:.2f} m off, {speed:.2f} m/s against the pad, tilt {tilt_deg:.0f} deg" if fits else None


def above_pad(facts: Facts, context: Context) -> str | None:
    if context.mission.follow_to_the_end and facts.plan_to_go_s != 0.0:
        return None
    if context.above_pad_for_s < context.mission.follow_time_s or facts.no_land_zone is not None:
        return None
    return f"within {context.mission.follow_radius_m:.1f} m for {context.above_pad_for_s:.1f} s"


BEHIND_LEVEL_M = 0.2
"""Behind a pad with an upright marker the vehicle waits until it is as high as the way to the pad asks for."""


def is_above_pad(facts: Facts, mission: Mission) -> bool:
    """At the place to wait for the descent (the pad's vertical, or behind the pad) and moving with it, seen right now."""
    away, speed = facts.relative_position_m, facts.relative_speed_m_s
    if away is None or speed is None or sight_age_s(facts, mission) > 0.3:
        return False
    north, east, down = waiting_place_m(mission.follow_height_m, facts, mission)
    level = mission.follow_behind_m == 0.0 or abs(away[2] - down) <= BEHIND_LEVEL_M
    near = math.hypot(away[0] - north, away[1] - east) <= mission.follow_radius_m
    return near and level and speed <= mission.follow_speed_m_s


def climbed(facts: Facts, context: Context) -> str | None:
    height = facts.height_above_pad_m
    if height is None or height < context.mission.follow_height_m - 0.5:
        return None
    return f"{height:.1f} m above the pad"


def is_in_sight(facts: Facts, mission: Mission) -> bool:
    """Seen within the last frames, and the estimate has settled on what was seen."""
    return facts.pad is not None and sight_age_s(facts, mission) < 0.3 and facts.pad.position_sigma_m < 1.0


def pad_in_sight(facts: Facts, context: Context) -> str | None:
    if facts.pad is None or context.stable_sight_for_s < context.mission.sight_time_s:
        return None
    return f"seen for {context.stable_sight_for_s:.1f} s, sigma {facts.pad.position_sigma_m:.2f} m"


def vision_lost(facts: Facts, context: Context) -> str | None:
    limits = {Phase.DESCEND: context.mission.vision_lost_descend_s}
    limit = limits.get(context.phase, context.mission.vision_lost_follow_s)
    age = sight_age_s(facts, context.mission)
    return f"pad not seen for {age:.1f} s" if age > limit else None


def sight_lost_hold(facts: Facts, context: Context) -> str | None:
    """As `vision_lost`, for those who wait in the autopilot's Hold instead of going around."""
    return vision_lost(facts, context) if context.mission.sight_lost_action == "hold" else None


def sight_back(facts: Facts, context: Context) -> str | None:
    """Only out of the Hold that Companion itself asked for because it saw nothing, and while the vehicle is still in it."""
    held = facts.status is not None and facts.status.mode is AutopilotMode.HOLD
    return pad_in_sight(facts, context) if context.holds_for_sight and held else None


def pad_lost(facts: Facts, context: Context) -> str | None:
    if facts.pad is None:
        return "no estimate of the pad"
    ages = [age for age in (facts.pad.vision_age_s, facts.pad.beacon_age_s) if age is not None]
    if ages and min(ages) <= context.mission.pad_lost_s:
        return None
    return f"nothing known of the pad for {min(ages, default=math.inf):.0f} s"


def _lost_for_good(action: str) -> Guard:
    def guard(facts: Facts, context: Context) -> str | None:
        if context.mission.lost_action != action or context.phase_age_s < context.mission.search_time_s:
            return None
        return f"searched for {context.phase_age_s:.0f} s"

    return guard


def pad_known(facts: Facts, context: Context) -> str | None:
    return None if pad_lost(facts, context) else "an estimate of the pad"


def sight_age_s(facts: Facts, mission: Mission) -> float:
    """Since the pad was last seen; where `mission.sight` is "beacon", since it was last heard of."""
    if facts.pad is None:
        return math.inf
    ages = [facts.sight_age_s] + ([facts.pad.beacon_age_s] if mission.sight == "beacon" else [])
    return min((age for age in ages if age is not None), default=math.inf)


GUARDS: dict[Event, Guard] = {
    Event.DISARMED: disarmed,
    Event.PILOT_TOOK_OVER: pilot_took_over,
    Event.AUTOPILOT_FAILSAFE: autopilot_failsafe,
    Event.LINK_LOST: link_lost,
    Event.STALLED: stalled,
    Event.OPERATOR_ABORT: _operator(OperatorAction.ABORT),
    Event.OPERATOR_RETURN: _operator(OperatorAction.RETURN),
    Event.OPERATOR_HOLD: _operator(OperatorAction.HOLD),
    Event.OPERATOR_GO_AROUND: _operator(OperatorAction.GO_AROUND),
    Event.START_IN_AIR: start_in_air,
    Event.START_ON_GROUND: start_on_ground,
    Event.OUTSIDE_FENCE: outside_fence,
    Event.BATTERY_LOW: battery_low,
    Event.FLIGHT_TOO_LONG: flight_too_long,
    Event.REQUEST_REFUSED: request_refused,
    Event.AIRBORNE: airborne,
    Event.OFFBOARD_GRANTED: offboard_granted,
    Event.NO_LANDING_HERE: no_landing_here,
    Event.TOUCHDOWN_SUSPECTED: touchdown_suspected,
    Event.TOUCHDOWN_LOST: touchdown_lost,
    Event.TOO_MANY_GO_AROUNDS: too_many_go_arounds,
    Event.COMMIT_UNSAFE: commit_unsafe,
    Event.OUTSIDE_CONE: outside_cone,
    Event.NO_PLAN: no_plan,
    Event.READY_TO_COMMIT: ready_to_commit,
    Event.ABOVE_PAD: above_pad,
    Event.CLIMBED: climbed,
    Event.PAD_IN_SIGHT: pad_in_sight,
    Event.SIGHT_LOST_HOLD: sight_lost_hold,
    Event.SIGHT_BACK: sight_back,
    Event.VISION_LOST: vision_lost,
    Event.PAD_LOST: pad_lost,
    Event.PAD_KNOWN: pad_known,
    Event.LOST_FOR_GOOD_HOLD: _lost_for_good("hold"),
    Event.LOST_FOR_GOOD_RETURN: _lost_for_good("return"),
}
