"""Properties of the simulated vehicle's mission protocol under any traffic."""

from __future__ import annotations

from hypothesis import example, given, settings
from hypothesis import strategies as st
from sim_client import HOME, Station, waypoint

from mrmission.simulate.storage import Item, Refusal, mission_item
from mrmission.simulate.transport import Faults
from mrmission.simulate.wire import mavlink

ACCEPTED = mavlink.MAV_MISSION_ACCEPTED
floats32 = st.floats(width=32, allow_nan=True, allow_infinity=True)
items = st.builds(
    Item,
    command=st.sampled_from(
        [0, 16, 17, 18, 19, 20, 22, 82, 93, 112, 177, 178, 195, 201, 206, 5001]
    ),
    frame=st.sampled_from([0, 2, 3, 5, 6, 10, 11, 12]),
    param1=floats32,
    param2=floats32,
    param3=floats32,
    param4=floats32,
    x=st.integers(-(2**31), 2**31 - 1),
    y=st.integers(-(2**31), 2**31 - 1),
    z=floats32,
)


@given(items)
@example(Item(16, 0, 0.0, 0.0, 0.0, 0.0, 0, 0, 26.359375))
@settings(max_examples=300, deadline=None)
def test_an_item_is_refused_or_stored_so_that_storing_it_again_keeps_it(item: Item) -> None:
    try:
        stored = mission_item(item)
    except Refusal:
        return
    again = mission_item(stored)
    assert again._replace(z=0.0) == stored._replace(z=0.0)
    # Centimetres are cut off in single precision, as ArduPilot does it: 26.35 m becomes 26.34 m.
    assert abs(again.z - stored.z) < 0.0101 + 1e-6 * abs(stored.z)
    assert all(value == value for value in stored)  # no NaN survives
    if item.command == 16:
        assert (stored.x, stored.y) == (item.x, item.y)


@given(
    st.integers(0, 2**16),
    st.floats(0, 0.15),
    st.floats(0, 0.15),
    st.floats(0, 0.15),
    st.integers(1, 12),
    st.integers(1, 12),
)
@settings(max_examples=40, deadline=None)
def test_after_accepted_the_vehicle_has_what_was_sent_and_otherwise_old_or_new_items(
    seed: int, loss: float, duplicate: float, reorder: float, old_count: int, new_count: int
) -> None:
    station = Station()
    old = [HOME, *(waypoint(i, 1000) for i in range(1, old_count))]
    assert station.upload(old) == ACCEPTED
    faults = Faults(loss=loss, duplicate=duplicate, reorder=reorder, seed=seed)
    noisy = Station(station.vehicle, faults=faults)
    new = [HOME, *(waypoint(i, -1000) for i in range(1, new_count))]
    result = noisy.upload(new)
    station.now_s = noisy.now_s
    station.wait(9.0)
    stored = station.download()
    assert isinstance(stored, list)
    positions = [(m.x, m.y) for m in stored]
    old_at, new_at = ([(i.x, i.y) for i in part] for part in (old, new))
    if result == ACCEPTED:
        assert positions == new_at
    for seq, position in enumerate(positions):
        assert position in (new_at[seq : seq + 1] + old_at[seq : seq + 1])
    # What is new comes first: items are written in order.
    fresh = [position in new_at[1:] for position in positions[1:]]
    assert fresh == sorted(fresh, reverse=True)


messages = st.one_of(
    st.tuples(st.just("count"), st.integers(0, 700), st.integers(0, 4)),
    st.tuples(st.just("item"), st.integers(0, 8), st.integers(0, 3)),
    st.tuples(st.just("request"), st.integers(0, 700), st.integers(0, 3)),
    st.tuples(st.just("list"), st.just(0), st.integers(0, 3)),
    st.tuples(st.just("partial"), st.integers(0, 9), st.integers(0, 2)),
    st.tuples(st.just("clear"), st.just(0), st.sampled_from([0, 1, 2, 255])),
    st.tuples(st.just("wait"), st.integers(1, 10), st.just(0)),
    st.tuples(st.just("current"), st.integers(0, 12), st.just(0)),
    st.tuples(st.just("mode"), st.sampled_from([0, 4, 5, 10, 11, 15, 3]), st.just(0)),
    st.tuples(st.just("arm"), st.integers(0, 1), st.just(0)),
)


@given(st.lists(st.tuples(messages, st.booleans()), max_size=40))
@settings(max_examples=60, deadline=None)
def test_no_order_of_messages_breaks_the_vehicle_or_locks_it_for_ever(script) -> None:
    first = Station()
    stations = (first, Station(first.vehicle, system_id=251, link=1))
    for (what, number, kind), second in script:
        station = stations[second]
        if what == "count":
            station.send(station.count_message(number, kind))
        elif what == "item":
            commands = {0: 16, 1: 5001, 2: 5100, 3: 16}
            item = waypoint(number, kind, command=commands[kind], param1=3.0 if kind == 1 else 0.0)
            station.send(station.item_message(number, item, kind))
        elif what == "request":
            station.send(mavlink.MAVLink_mission_request_int_message(1, 1, number, kind))
        elif what == "list":
            station.send(mavlink.MAVLink_mission_request_list_message(1, 1, kind))
        elif what == "partial":
            station.send(
                mavlink.MAVLink_mission_write_partial_list_message(1, 1, number, number + 1, kind)
            )
        elif what == "clear":
            station.send(mavlink.MAVLink_mission_clear_all_message(1, 1, kind))
        elif what == "wait":
            later = max(s.now_s for s in stations) + float(number)
            for s in stations:
                s.now_s = later
            station._arrive(first.vehicle.step(later))
        elif what == "current":
            station.send(mavlink.MAVLink_mission_set_current_message(1, 1, number))
        elif what == "mode":
            station.command(mavlink.MAV_CMD_DO_SET_MODE, 1, number)
        else:
            station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, number, 21196)
    first.now_s = max(s.now_s for s in stations)
    first.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196)
    first.wait(9.0, 1.0)
    for kind in (0, 1, 2):
        assert isinstance(first.download(kind), list)
    assert first.upload([HOME, waypoint(1, 1)]) == ACCEPTED
