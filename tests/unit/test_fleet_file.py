from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from mrmission import quantity
from mrmission.cli.options import build_options, plan_options
from mrmission.errors import ConfigError, InputError
from mrmission.fleet import Robot, read_fleet, swath_note
from mrmission.options import PlanOptions

MIXED = """
swath = "20 m"
survey-speed = 1.5
endurance = "2 h"

[[robot]]
name = "Otter"
count = 2

[[robot]]
name = "Heron"
survey-speed = "3.6 km/h"
transit-speed = 3
swath = 30
endurance = "12km"
reserve = "10%"
max-items = 300
"""


def fleet(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "fleet.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_fills_in_what_the_top_says(tmp_path: Path) -> None:
    otter, other, heron = read_fleet(fleet(tmp_path, MIXED)).robots()
    assert (otter.name, other.name, heron.name) == ("Otter 1", "Otter 2", "Heron")
    assert otter == Robot(
        name="Otter 1", swath_m=20.0, survey_speed_m_s=1.5, transit_speed_m_s=1.5,
        endurance_s=7200.0,
    )  # fmt: skip
    assert heron.survey_speed_m_s == pytest.approx(1.0)
    assert heron.transit_speed_m_s == 3.0
    # a distance of its own takes the place of the time that holds for all
    assert (heron.endurance_s, heron.endurance_m) == (None, 12_000.0)
    assert (heron.reserve, heron.max_items) == (0.1, 300)


def test_flags_come_before_the_top_and_after_the_tables(tmp_path: Path) -> None:
    file = read_fleet(fleet(tmp_path, MIXED))
    otter, _, heron = file.robots({"swath_m": 12.0, "endurance_m": 500.0, "endurance_s": None})
    assert (otter.swath_m, heron.swath_m) == (12.0, 30.0)
    assert (otter.endurance_s, otter.endurance_m) == (None, 500.0)
    assert heron.endurance_m == 12_000.0
    assert file.robots({"robots": 3}, {"wp_radius_m": 2.0})[0].wp_radius_m == 2.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("swaht = 20\n[[robot]]", ("unknown key 'swaht'", "did you mean swath?")),
        ('[[robot]]\nname = "Bo"\nsped = 1', ("[[robot]] 1 (Bo)", "unknown key 'sped'")),
        ('name = "x"\n[[robot]]', ("unknown key 'name'", "in a [[robot]]")),
        ('[[robot]]\nvehicle = "boat"', ("unknown key 'vehicle'", "at the top of the file")),
        ("[[robot]]\nfrobnicate = 1", ("unknown key 'frobnicate'", "known are")),
        ("[[robot]]\nendurance = 45", ("[[robot]] 1: endurance = 45", "a time (45min")),
        ('[[robot]]\nendurance = "0min"', ("above 0",)),
        ('[[robot]]\n[[robot]]\nswath = "wide"', ('[[robot]] 2: swath = "wide"', "a number")),
        ('[[robot]]\nswath = "20 kn"', ("unknown unit 'kn'", "km")),
        ("[[robot]]\nswath = 0.2", ("at least 0.5",)),
        ("[[robot]]\nsurvey-speed = -1", ("above 0",)),
        ('[[robot]]\nreserve = "95%"', ("from 0 to 90%",)),
        ('[[robot]]\nswap-time = "-1 min"', ("0 or more",)),
        ("[[robot]]\nmax-items = 7.5", ("whole number",)),
        ("[[robot]]\nmax-items = 3", ("at least 8",)),
        ('[[robot]]\nsteering = "sideways"', ("steered, pivoting",)),
        ('[[robot]]\nstart = "1,2,3"', ("LON,LAT",)),
        ("[[robot]]\nstart = [1, 99]", ("LON,LAT",)),
        ("[[robot]]\nswath = 1\nSwath = 2", ("unknown key 'Swath'",)),
        ("[[robot]]\nwp-radius = 1\nwp_radius = 2", ("wp-radius is given twice",)),
        ("[[robot]]\ncount = 0", ("at least 1",)),
        ("[[robot]]\ncount = 251", ("at most 250",)),
        ("[robot]\nswath = 1", ("[[robot]]",)),
        ("robot = 3", ("[[robot]]",)),
        ("swath = 20", ("has no [[robot]]",)),
        ('vehicle = "car"\n[[robot]]', ("boat, rover, copter",)),
    ],
)
def test_what_cannot_be_used_is_named(tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    path = fleet(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        read_fleet(path).robots()
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_file_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_fleet(tmp_path / "none.toml")
    with pytest.raises(InputError, match="is no TOML"):
        read_fleet(fleet(tmp_path, "a ="))


def test_contradictions(tmp_path: Path) -> None:
    file = read_fleet(fleet(tmp_path, MIXED))
    with pytest.raises(ConfigError, match=r"--k 2 and --fleet .*: the file has 3 robots"):
        file.robots({"robots": 2})
    own = read_fleet(fleet(tmp_path, "[[robot]]\nswath = 10\n[[robot]]\nswath = 12"))
    with pytest.raises(ConfigError, match="every robot of the file has its own swath"):
        own.robots({"swath_m": 9.0})
    some = read_fleet(fleet(tmp_path, '[[robot]]\nstart = "1,2"\n[[robot]]'))
    with pytest.raises(ConfigError, match="robot 2 has no start"):
        some.robots()


@pytest.mark.parametrize(
    ("read", "text", "value"),
    [
        (quantity.length_m, "12km", 12_000.0),
        (quantity.length_m, "0.5 nmi", 926.0),
        (quantity.speed_m_s, "2 kn", 2 * 1852 / 3600),
        (quantity.time_s, "1h 30 min", 5400.0),
        (quantity.time_s, "45 MIN", 2700.0),
        (quantity.share, "12.5 %", 0.125),
    ],
)
def test_quantities(read: object, text: str, value: float) -> None:
    assert read(text) == pytest.approx(value)  # type: ignore[operator]


@pytest.mark.parametrize("text", ["", "m", "1 2", "1 m 2", "nan", "1e999", "5 parsec", True, None])
def test_what_is_no_length(text: object) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        quantity.length_m(text)


def built(*arguments: str) -> PlanOptions:
    """The options of a command line."""
    import click

    found: list[PlanOptions] = []

    @click.command()
    @plan_options
    def command(**flags: object) -> None:
        found.append(build_options(**flags))

    result = CliRunner().invoke(command, list(arguments), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return found[0]


def test_the_command_line_and_the_file(tmp_path: Path) -> None:
    path = fleet(tmp_path, MIXED)
    options = built("--fleet", str(path), "--swath", "15", "--wp-radius", "2")
    assert options.robots == 3
    assert options.swath_m == 15.0  # the narrowest
    first, last = options.of_robot(1), options.of_robot(3)
    assert (first.swath_m, last.swath_m) == (15.0, 30.0)
    assert (first.wp_radius_m, last.wp_radius_m) == (2.0, 2.0)
    assert (first.limits.mission_items, last.limits.mission_items) == (655, 300)
    assert first.of_robot(2) is first
    json.dumps(options.as_dict(), allow_nan=False)
    for flags, words in (
        (("--k", "2"), "the file has 3 robots"),
        (("--endurance", "3"), "must be a time"),
        (("--reserve", "1"), "from 0 to 90%"),
    ):
        with pytest.raises(ConfigError, match=words):
            built("--fleet", str(path), *flags)


def test_starts_of_the_file(tmp_path: Path) -> None:
    text = '[[robot]]\nstart = "11.2,47.8"\n[[robot]]\nstart = [11.3, 47.9]'
    options = built("--fleet", str(fleet(tmp_path, text)))
    assert options.starts_lonlat == ((11.2, 47.8), (11.3, 47.9))
    with pytest.raises(ConfigError, match="own start"):
        built("--fleet", str(fleet(tmp_path, text)), "--start", "1,2")
    shared = fleet(tmp_path, 'start = "11.2,47.8"\n[[robot]]\ncount = 3')
    assert built("--fleet", str(shared)).starts_lonlat == ((11.2, 47.8),)
    assert built("--fleet", str(shared), "--start", "1,2").starts_lonlat == ((1.0, 2.0),)
    mixed = fleet(tmp_path, 'start = "11.2,47.8"\n[[robot]]\n[[robot]]\nstart = "11.3,47.9"')
    assert built("--fleet", str(mixed)).starts_lonlat == ((11.2, 47.8), (11.3, 47.9))


def test_flags_alone() -> None:
    options = built("--endurance", "45min", "--reserve", "10%", "--swap-time", "5 min")
    assert (options.endurance_s, options.endurance_m) == (2700.0, None)
    assert (options.reserve, options.swap_time_s) == (0.1, 300.0)
    assert built("--endurance", "12km").endurance_m == 12_000.0
    assert built().endurance_s is None


def test_the_note_on_swaths() -> None:
    assert swath_note(()) is None
    assert swath_note((Robot(), Robot())) is None
    note = swath_note((Robot(), Robot(swath_m=30.0)))
    assert note is not None
    assert "narrowest swath, 20 m" in note
    assert "robot 2 is not used" in note
