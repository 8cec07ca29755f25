"""The map page in a real browser: it draws, complains about nothing, and its switches work."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess

import pytest
from factories import make_plan

from mrmission.report.colours import DARK, LIGHT
from mrmission.report.map_page import map_html

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed: the map is not tried"),
]

# Before the page's own script: frames come when frame() asks for them, so that nothing here waits
# for a clock, and the canvas is drawn without a GPU, so that the same page gives the same pixels.
PRELUDE = """
<script>
const queue = [];
window.requestAnimationFrame = (callback) => queue.push(callback);
const frame = () => { while (queue.length) queue.shift()(0); };
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind) {
  return getContext.call(this, kind, { willReadFrequently: true });
};
</script>
</head>
"""

# After it; what it finds comes back through the dumped DOM.
HARNESS = """
<pre id="outcome"></pre>
<script>
window.addEventListener("load", () => {
  const outcome = {};
  const canvas = document.getElementById("map");
  const mouse = (type, x, y, more) => {
    const box = canvas.getBoundingClientRect();
    canvas.dispatchEvent(new PointerEvent(type, {
      clientX: box.left + x, clientY: box.top + y, pointerId: 1, pointerType: "mouse",
      bubbles: true, cancelable: true, ...more }));
  };
  const key = (name) => canvas.dispatchEvent(
    new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true }));
  const pixels = () => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const count = (colour) => {
    const want = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16)), data = pixels();
    let found = 0;
    for (let i = 0; i < data.length; i += 4) {
      if (want.every((value, c) => Math.abs(data[i + c] - value) < 12)) found++;
    }
    return found;
  };
  const sum = () => pixels().reduce((all, value, i) => (all * 31 + value * (i % 97)) % 1000003, 7);
  const bar = () => document.getElementById("bar-text").textContent;
  const tip = () => {
    const box = document.getElementById("tip");
    return box.hidden ? null : box.textContent;
  };
  try {
    frame();
    @SCRIPT@
  } catch (error) {
    outcome.error = String(error);
  }
  document.getElementById("outcome").textContent = JSON.stringify(outcome);
});
</script>
</body>
"""


def browse(tmp_path, plan, script, *flags, size="1000,700"):
    """Open the plan's page, run the script in it; return its outcome and the console's lines."""
    page = tmp_path / "map.html"
    page.write_text(
        map_html(plan)
        .replace("</head>", PRELUDE, 1)
        .replace("</body>", HARNESS.replace("@SCRIPT@", script)),
        encoding="utf-8",
    )
    command = [
        BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
        f"--user-data-dir={tmp_path / 'profile'}", "--disable-dev-shm-usage", "--hide-scrollbars",
        f"--window-size={size}", "--enable-logging=stderr",
        *flags, "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    found = re.search(r'<pre id="outcome">(.*?)</pre>', done.stdout, re.DOTALL)
    outcome = found[1] if found else ""
    assert outcome, f"no outcome; console: {console}; {done.stderr[-2000:]}"
    return json.loads(html.unescape(outcome)), console


def test_page_draws_and_switches(tmp_path):
    light = json.dumps(LIGHT[:3])
    script = f"""
    const colours = {light};
    outcome.all = colours.map(count);
    const boxes = [...document.querySelectorAll("input.robot")];
    boxes[1].click(); frame();
    outcome.without2 = colours.map(count);
    document.getElementById("none").click(); frame();
    outcome.none = colours.map(count);
    document.getElementById("all").click(); frame();
    outcome.again = colours.map(count);
    document.querySelector("#robots tr[data-robot='3'] td").click(); frame();
    outcome.alone = colours.map(count);
    document.querySelector("#robots tr[data-robot='3'] td").click(); frame();
    outcome.back = colours.map(count);
    document.querySelector("input.layer[value='lanes']").click(); frame();
    outcome.withoutLanes = colours.map(count);
    outcome.checked = boxes.map((box) => box.checked);
    """
    outcome, console = browse(tmp_path, make_plan(robots=3), script)
    assert console == []
    assert "error" not in outcome, outcome
    assert all(number > 300 for number in outcome["all"])
    assert outcome["without2"][1] == 0
    assert outcome["without2"][0] > 300
    assert outcome["none"] == [0, 0, 0]
    assert outcome["again"] == outcome["back"] == outcome["all"]
    assert outcome["alone"][:2] == [0, 0]
    assert outcome["alone"][2] > 300
    assert all(
        0 < less < more / 2
        for less, more in zip(outcome["withoutLanes"], outcome["all"], strict=True)
    )
    assert outcome["checked"] == [True, True, True]


def test_page_moves_zooms_and_tells(tmp_path):
    script = """
    const first = sum();
    outcome.bar = bar();
    const middle = [canvas.clientWidth / 2, canvas.clientHeight / 2];
    canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -600, clientX: 300, clientY: 300,
      bubbles: true, cancelable: true })); frame();
    outcome.wheel = [sum() !== first, bar()];
    key("0"); frame();
    outcome.fit = sum() === first;
    for (const name of ["ArrowLeft", "ArrowUp", "+"]) { key(name); frame(); }
    outcome.keys = sum() !== first;
    document.getElementById("fit").click(); frame();
    mouse("pointerdown", 200, 200); mouse("pointermove", 260, 250); mouse("pointerup", 260, 250);
    frame();
    outcome.drag = sum() !== first;
    key("0"); frame();
    key("n"); frame();
    outcome.step = tip();
    key("n"); frame();
    outcome.step2 = tip();
    key("Escape");
    outcome.escape = tip();
    let hits = 0, words = null;
    for (let x = 60; x < canvas.clientWidth - 60; x += 3) {
      mouse("pointermove", x, middle[1]);
      if (tip()) { hits++; words = tip(); }
    }
    outcome.hover = [hits, words];
    mouse("pointermove", middle[0], middle[1]);
    outcome.cursor = document.getElementById("cursor").textContent;
    """
    outcome, console = browse(tmp_path, make_plan(robots=3), script)
    assert console == []
    assert "error" not in outcome, outcome
    assert outcome["wheel"][0]
    assert outcome["wheel"][1] != outcome["bar"]
    assert outcome["fit"]
    assert outcome["keys"]
    assert outcome["drag"]
    assert re.match(r"Robot 1: transit\nto item 1, ", outcome["step"])
    assert re.match(r"Robot 1: lane 1\nto item 3, ", outcome["step2"])
    assert outcome["escape"] is None
    hits, words = outcome["hover"]
    assert hits > 20
    assert re.match(
        r"Robot \d: (lane \d+|transit)\nto item \d+, [\d.]+ k?m\n"
        r"[\d.]+ k?m of [\d.]+ km from the start",
        words,
    )
    # The factory's lake lies about 47.5 N 11.2 E.
    lon, lat = map(float, outcome["cursor"].split(","))
    assert abs(lon - 11.2) < 0.01
    assert abs(lat - 47.5) < 0.01


def test_page_in_the_dark_and_with_a_hostile_name(tmp_path):
    plan = make_plan(robots=2, name="</script><script>throw new Error('x')</script>")
    script = f"outcome.dark = {json.dumps(DARK[:2])}.map(count); outcome.title = document.title;"
    dark = "--blink-settings=preferredColorScheme=0"
    outcome, console = browse(tmp_path, plan, script, dark)
    assert console == []
    assert all(number > 300 for number in outcome["dark"])
    assert "throw new Error" in outcome["title"]


def test_fifty_thousand_points(tmp_path):
    plan = make_plan(robots=32, swath_m=3.0, lane_points=100)
    assert sum(len(mission.items) for mission in plan.missions) > 50_000
    # What is drawn is counted, not the seconds: those are the machine's.
    script = """
    const whole = { lines: 0 }, near = { lines: 0 }, lineTo = Path2D.prototype.lineTo;
    let into = whole;
    Path2D.prototype.lineTo = function (x, y) { into.lines++; return lineTo.call(this, x, y); };
    key("ArrowLeft"); frame();
    into = near;
    for (let i = 0; i < 9; i++) key("+");
    frame();
    outcome.whole = whole.lines; outcome.near = near.lines;
    """
    outcome, console = browse(tmp_path, plan, script)
    assert console == []
    assert outcome["whole"] > 1000
    assert 10 < outcome["near"] < outcome["whole"] / 5
