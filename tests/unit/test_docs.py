"""The documentation is true where a machine can tell: links, commands, pages, figures."""

from __future__ import annotations

import importlib.util
import re
import shlex
from pathlib import Path
from types import ModuleType

import click
import pytest

from mrmission.cli.main import COMMANDS, cli

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *DOCS.rglob("*.md"),
        ROOT / "sitl" / "README.md",
        ROOT / "geofences" / "README.md",
    ]
)
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^()\s]+)\)")
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def ids(path: Path) -> str:
    return str(path.relative_to(ROOT))


def prose(text: str) -> str:
    return FENCED.sub("", text)


def slugs(page: Path) -> set[str]:
    """Anchors of a page, as GitHub and mkdocs make them."""
    out = set()
    for title in re.findall(r"^#+ (.*)$", prose(page.read_text(encoding="utf-8")), re.MULTILINE):
        plain = re.sub(r"[^\w\s-]", "", title.replace("`", "")).strip().lower()
        out.add(re.sub(r"[\s]+", "-", plain))
    return out


def commands(text: str) -> list[str]:
    """Lines of fenced or indented blocks that call mrmission, continued lines joined."""
    blocks = [body for language, body in FENCED.findall(text) if language in ("console", "bash")]
    blocks += re.findall(r"(?:^(?: {4}\S.*)\n)+", prose(text), re.MULTILINE)
    lines = [
        line.strip().removeprefix("$ ")
        for block in blocks
        for line in block.replace("\\\n", " ").splitlines()
    ]
    return [line for line in lines if line.startswith("mrmission ")]


def top() -> click.Context:
    # with the program's own settings: click keeps the help option of the first context it meets
    return click.Context(cli, info_name="mrmission", **cli.context_settings)


def load(script: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(script.stem, script)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_links_and_images_lead_somewhere(page: Path) -> None:
    broken = []
    for target in LINK.findall(prose(page.read_text(encoding="utf-8"))):
        if target.startswith(("http://", "https://", "mailto:")):
            continue
        name, _, anchor = target.partition("#")
        there = (page.parent / name).resolve() if name else page
        if not there.exists() or (anchor and anchor not in slugs(there)):
            broken.append(target)
    assert broken == []


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_commands_parse(page: Path) -> None:
    """Every option exists and every value has its type; nothing is run."""
    for line in commands(page.read_text(encoding="utf-8")):
        words = shlex.split(line, comments=True)[1:]
        if words[0].startswith("-"):
            assert words[0] in ("--help", "-h", "--version", "--debug"), line
            continue
        command = cli.get_command(top(), words[0])
        assert command is not None, line
        try:
            command.make_context(words[0], words[1:], parent=top())
        except click.exceptions.Exit:
            continue  # --help
        except click.UsageError as error:
            pytest.fail(f"{ids(page)}: {line}: {error.format_message()}")


def test_commands_are_found_at_all() -> None:
    """The test above is not empty, and sees through a wrong option."""
    assert len(commands((ROOT / "README.md").read_text(encoding="utf-8"))) >= 6
    text = "```bash\nmrmission plan \\\n  lake.geojson --nope 3\n```\n\n    mrmission sim --k 2\n"
    assert commands(text) == ["mrmission plan    lake.geojson --nope 3", "mrmission sim --k 2"]
    plan = cli.get_command(top(), "plan")
    assert plan is not None
    with pytest.raises(click.NoSuchOption):
        plan.make_context("plan", ["lake.geojson", "--nope", "3"], parent=top())


OF_OTHERS = {"--serial0", "--model", "--home"}


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_options_that_are_named_exist(page: Path) -> None:
    known = {"--help", "--version", "--debug", *OF_OTHERS}
    for name in COMMANDS:
        command = cli.get_command(top(), name)
        assert command is not None
        inside = command.commands.values() if isinstance(command, click.Group) else ()
        for parameter in (p for c in (command, *inside) for p in c.params):
            known.update(parameter.opts + parameter.secondary_opts)
    code = re.findall(r"`([^`\n]+)`", prose(page.read_text(encoding="utf-8")))
    named = {flag for span in code for flag in re.findall(r"(?<![\w-])--[a-z][\w-]*", span)}
    assert named - known == set()


def test_cli_page_is_current() -> None:
    page = load(DOCS / "make_cli.py").page()
    assert (DOCS / "cli.md").read_text(encoding="utf-8") == page, "run python docs/make_cli.py"


def test_nav_and_pages_are_the_same() -> None:
    nav = re.findall(r": (\S+\.md)$", (ROOT / "mkdocs.yml").read_text("utf-8"), re.MULTILINE)
    assert len(nav) == len(set(nav))
    assert set(nav) == {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")}


def test_figures_are_small_made_and_shown() -> None:
    files = sorted((DOCS / "figures").iterdir())
    pytest.importorskip("matplotlib")
    made = set(load(DOCS / "make_figures.py").FIGURES)
    made.add("driven")  # of a voyage of two hours: docs/measure_driven.py
    made |= {"scaling", "methods"}  # of hundreds of plans: docs/measure_scaling.py, measure_gaps.py
    # of `mrmission experiments paper`, a run of its own
    made |= {file.stem for file in files if file.stem.startswith("study-")}
    assert {file.stem for file in files} == made
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for file in files:
        assert f"figures/{file.name}" in text, file.name
        assert file.stat().st_size < 150_000, file.name
    assert sum(file.stat().st_size for file in files) < 1_500_000
