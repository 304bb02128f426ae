"""Writes REFERENCE.md and its pictures: keys of a study, variables, figures; ``python studies/reference.py``.

The text comes from the declarations that the program itself reads, and a test holds it against them.
"""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, get_args, get_origin, get_type_hints

from matplotlib.figure import Figure

from workflow import models, plots, reduction, schemes, variables
from workflow.declare import quantity_of, word_of
from workflow.models._matrix_files import ENTRIES
from workflow.study.document import settings
from workflow.study.settings import (
    TOLERANCE,
    CaseSettings,
    Casing,
    CasingHarmonic,
    Friction,
    Initial,
    Load,
    LoadHarmonic,
    Output,
    Scene,
    Steady,
)

FILE = Path(__file__).with_name("REFERENCE.md")

HEAD = """# Reference

Written by `python studies/reference.py` from the declarations that the program reads.

## Keys of a study

A number is SI; a string is `number unit`. α is friction heat that enters the blade per contact force and second,
friction coefficient × sliding speed × share of the heat: W/N, which is m/s. A study gives it as `alpha`, or as
`scene.friction` with these three numbers: then it is the coordinate `alpha` along their dimensions. Values marked
“list” take a scalar or one value for each node or spring, root to tip; of the casing one for each contact.
"""

TOP = (
    ("study", "identifier; also the default name of the archive"),
    ("title", "one line on what the study shows"),
    ("license", "licence of the archive; none is written where it is left out"),
    ("scene", "one model, `casing`, `load`, `initial`, `duration`, `speed`, `friction`"),
    ("schemes", "label: method and its options; a bare method name needs no entry"),
    ("axes", "settings of a case and values of the scene or of schemes by dotted path: a value, a list, "
     "`{lin: [first, last, count]}` or `{log: [first, last, count]}`; each list is a dimension. One real-valued axis "
     "may be `{branch: [from, to, points]}`: branches of steady rubs are followed along it, and another beside it "
     "`{boundary: [from, to, points]}`: their bifurcations are followed over both; one of the load, of "
     "friction, `scene.speed` or `alpha` may be `{sweep: [from, to, count]}`: each point starts from the state in "
     "which the one before ended"),
    ("zip", "axes that vary together, by the name of their dimension; or numbers of the scene, `e` and `alpha`, "
     "drawn: `{sample, points, seed, of}`"),
    ("zip.NAME.sample", "`random`, `latin_hypercube`, or `sobol_indices`: points × (numbers + 2) cases"),
    ("zip.NAME.points", "number of points; of `sobol_indices` a power of two"),
    ("zip.NAME.seed", "what the generator starts from; default 0"),
    ("zip.NAME.of", "path: `[low, high]`, uniform, or `{log: [low, high]}`, uniform in the logarithm"),
    ("reference", "settings of the solution that errors are measured against; the rest stays the case's own"),
    ("output", "what the archive keeps"),
)  # fmt: skip


def keys(declared: Any, path: str) -> Iterator[tuple[str, str, str, str]]:
    """Yield path, unit, default and meaning of the values of a declared dataclass."""
    hints = get_type_hints(declared)
    for entry in dataclasses.fields(declared):
        if entry.metadata.get("of_scene"):
            continue
        quantity, word, hint = quantity_of(entry), word_of(entry), hints[entry.name]
        hint = get_args(hint)[0] if type(None) in get_args(hint) else hint
        place = f"{path}{entry.name}"
        if quantity is not None:
            bounds = [
                f"{sign} {bound:g}"
                for sign, bound in ((">", quantity.above), ("≥", quantity.at_least), ("≤", quantity.at_most))
                if bound is not None
            ]
            meaning = "; ".join(filter(None, [quantity.description, ", ".join(bounds), "list" if quantity.per else ""]))
            yield place, quantity.unit, default(entry), meaning
        elif word is not None:
            yield place, "file" if word.file else "text", default(entry), word.description
        elif isinstance(hint, type) and dataclasses.is_dataclass(hint):
            yield from keys(hint, f"{place}.")
        elif get_origin(hint) is tuple and dataclasses.is_dataclass(get_args(hint)[0]):
            yield (
                place,
                "",
                default(entry),
                "list of mappings, see below; any number of an entry by its position may vary",
            )
        else:
            yield place, "", default(entry), choices(entry, hint)


def choices(entry: dataclasses.Field[Any], hint: Any) -> str:
    """Return the words that a value may be, and its meaning where it has one."""
    if get_origin(hint) is tuple:
        hint = get_args(hint)[0]
    words = ", ".join(f"`{word}`" for word in get_args(hint)) if get_origin(hint) is Literal else ""
    return "; ".join(filter(None, [str(entry.metadata.get("meaning", entry.name.replace("_", " "))), words]))


def default(entry: dataclasses.Field[Any]) -> str:
    """Return the default of a value, `required` where it has none and its description tells none."""
    if entry.default is dataclasses.MISSING:
        quantity = quantity_of(entry)
        return (quantity.description.partition("default: ")[2] if quantity else "") or "required"
    value = entry.default
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(map(str, value)) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def table(rows: list[tuple[str, ...]], *head: str) -> list[str]:
    """Return a table in Markdown."""
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    return [*lines, *("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows), ""]


def key_tables() -> Iterator[str]:
    """Yield the lines on the keys of a study."""
    yield from table([(f"`{name}`", meaning) for name, meaning in TOP], "key", "what it holds")
    groups: list[tuple[str, Any, str]] = [("Settings of a case, under `axes`", CaseSettings, "")]
    groups += [(f"Model `{n}`, under `scene.{n}`", models.load(n).Parameters, f"scene.{n}.") for n in models.names()]
    groups += [
        ("Casing", Casing, "scene.casing."),
        (
            "Entries of `casing.harmonics`, each with `frequency` or `order`",
            CasingHarmonic,
            "scene.casing.harmonics.0.",
        ),
        ("Load", Load, "scene.load."),
        ("Entries of `load.harmonics`, each with `frequency` or `order`", LoadHarmonic, "scene.load.harmonics.0."),
        ("Friction, where it makes α; not beside `alpha`", Friction, "scene.friction."),
        ("Initial state; or `initial: static`, at rest under the constant loads", Initial, "scene.initial."),
        ("Duration and speed", Scene, "scene."),
    ]
    groups += [(f"Options of `{n}`", schemes.load(n).Options, "schemes.LABEL.") for n in schemes.names()]
    groups.append(("Output", Output, "output."))
    groups.append(("Steady rubs; or `steady: true`", Steady, "output.steady."))
    for title, declared, path in groups:
        rows = [
            row for row in keys(declared, path) if declared is not Scene or row[0] in ("scene.duration", "scene.speed")
        ]
        rows = [row for row in rows if declared is not Output or not row[0].startswith("output.steady")]
        rows = [row for row in rows if declared is not CaseSettings or is_setting(_field(CaseSettings, row[0]))]
        rows += [tolerance()] if declared is CaseSettings else []
        if rows:
            yield f"### {title}"
            yield ""
            shown = [(f"`{name}`", unit, value, meaning) for name, unit, value, meaning in rows]
            yield from table(shown, "key", "unit", "default", "meaning")
    yield "### Entries of a file of matrices"
    yield ""
    entries = [
        (f"`{name}`", " × ".join(each.axes), each.unit or "text", each.meaning) for name, each in ENTRIES.items()
    ]
    yield from table(entries, "entry", "a number for each", "unit", "meaning")
    yield "### Bases, values of `reduction`"
    yield ""
    yield from table([(f"`{name}`", about_basis(name)) for name in reduction.names()], "basis", "what it is")


def tolerance() -> tuple[str, str, str, str]:
    """Return the row of the one setting without a default."""
    about = settings()[TOLERANCE]
    return TOLERANCE, about.kind.unit, "none", f"{about.meaning}; needed where a count of modes is `auto`"


def is_setting(entry: dataclasses.Field[Any]) -> bool:
    """Tell whether a field of a case is a value of a study, not its scene or scheme."""
    return quantity_of(entry) is not None or word_of(entry) is not None


def about_basis(name: str) -> str:
    """Return the first paragraph of the docstring of a basis."""
    return str(import_module(f"{reduction.__name__}.{name}").__doc__).split("\n\n")[0].replace("\n", " ")


def _field(declared: Any, name: str) -> dataclasses.Field[Any]:
    return next(entry for entry in dataclasses.fields(declared) if entry.name == name.split(".")[0])


SHAPES = {
    "history": "(…, t)",
    "metric": "(…)",
    "text": "(…), text",
    "period": "(…, period)",
    "flag": "(…), int8",
    "phase": "(…, phase)",
    "point": "(…, point), int8",
    "uncertain point": "(…, uncertain, point)",
    "curve": "(…, curve), int8",
    "curve curve_point": "(…, curve, curve_point)",
    "event": "(…, event)",
    "sector": "(…, sector)",
    "revolution sector": "(…, revolution, sector)",
}
WHEN = {
    "always": "",
    "depth": "with `output.temperature_depth`",
    "balances": "with `output.balances`",
    "sections": "with `output.sections`",
    "sensors": "with `output.sensors`",
    "events": "with `output.events`",
    "coating": "with `casing.coating`",
    "wear": "with `output.wear`",
    "contacts": "of several contacts",
    "steady": "with `output.steady`; along `point` of a branch",
    "steady sensors": "with `output.steady` and `output.sensors`; along `point` of a branch",
    "branch": "where an axis is a branch",
    "uncertain": "with `output.steady.uncertain`",
    "boundary": "where an axis is a boundary",
    "reference": "with a `reference`",
    "scheme": "",
    "auto": "with `auto`",
    "auto reference": "with `auto` in the `reference`",
}


def variable_table() -> Iterator[str]:
    """Yield the lines on the variables of an archive."""
    yield "## Variables of an archive"
    yield ""
    yield "`…` stands for the dimensions of the study, followed by `contact` where a structure has several contacts and"
    yield "the variable is marked “each contact”. `message` says what a case did that is not ok. Along a drawn zip lie"
    yield "`sample_point`, the point of a case, and `sample_matrix`: `A`, `B`, or the path of what A has from B."
    yield ""
    rows = [_row(about, WHEN[about.condition]) for about in variables.TABLE]
    for name in schemes.names():
        rows += [_row(about, f"with `{name}`") for about in schemes.metrics(name)]
    merged: dict[str, tuple[str, ...]] = {}
    for row in rows:
        known = merged.get(row[0])
        merged[row[0]] = row if known is None else (*known[:-1], f"{known[-1]}, {row[-1].removeprefix('with ')}")
    yield from table(list(merged.values()), "variable", "shape", "unit", "meaning", "when")


def _row(about: variables.Variable, when: str) -> tuple[str, ...]:
    meaning = about.meaning + (f": {about.comment}" if about.comment else "")
    shape = SHAPES[about.shape] + (", each contact" if about.is_of_contact else "")
    shape = shape.replace("…", "…, sensor") if about.is_of_sensor else shape
    return f"`{about.name}`", shape, about.unit, meaning, when


FIGURES = {
    "histories": """archive = open_archive("../data/abstract_figure.nc")
figure = histories(archive.sel(scheme="event_driven").isel(model=0), along="alpha")""",
    "scene_map": """study = read_study("atlas.yaml").with_(
    {
        "axes.scene.load.amplitude": 12.875,
        "axes.e": 0.6,
        "axes.scene.casing.gap": {"lin": [1e-6, 1.08e-5, 15]},
        "axes.alpha": {"lin": [0, 5.5125, 15]},
    }
)
figure = scene_map(run_study(study, directory + "/atlas.nc").dataset, "alpha", "gap")""",
    "work_precision": """archive = open_archive("../data/work_precision.nc")
figure = work_precision(archive.isel(model=0), beside=archive.isel(model=1))""",
    "convergence": """archive = open_archive("../data/work_precision.nc")
figure = convergence(archive.sel(e=0).isel(model=0))""",
    "sobol_indices": """ranges = {"scene.casing.gap": ["15 um", "22 um"], "alpha": {"log": [1, 30]}, "e": [0, 0.9]}
design = {"sample": "sobol_indices", "points": 256, "of": ranges}
study = read_study("blade.yaml").with_({"axes": {"scheme": "event_driven"}, "zip": {"design": design}})
figure = sobol_indices(run_study(study, directory + "/drawn.nc").dataset)""",
    "bifurcation": """scene = {
    "chain": {"nodes": 1, "mass": 2.5e-3, "stiffness": 4e6, "damping": {"mass": 800}, "heat_capacity": 1},
    "casing": {"gap": "5 um"},
    "load": {"amplitude": 100},
    "duration": "40 ms",
}
axes = {"scheme": "event_driven", "e": 0.8, "scene.load.frequency": {"lin": [14e3, 20e3, 301]}}
study = read_study({"study": "rub", "scene": scene, "axes": axes, "output": {"sections": True, "histories": []}})
figure = bifurcation(run_study(study, directory + "/rub.nc").dataset, "frequency")""",
    "sweep": """scene = {
    "chain": {"nodes": 1, "mass": 0.01, "stiffness": 3948, "damping": {"mass": 63}, "heat_capacity": 1},
    "casing": {"gap": "0.1 mm"},
    "load": {"amplitude": 0.08},
    "initial": {"displacement": "-0.3 mm"},
    "duration": 1,
}


def run(name, axis):
    axes = {"scheme": "event_driven", "e": 0.3, "scene.load.frequency": axis}
    study = {"study": name, "scene": scene, "axes": axes, "output": {"interval": 1e-4, "histories": []}}
    return run_study(study, f"{directory}/{name}.nc").dataset


up, down = run("up", {"sweep": [99, 130, 63]}), run("down", {"sweep": [130, 99, 63]})
figure = sweep(up, "period_impulse", down, run("steady", {"branch": [99, 130, 200]}))""",
    "boundary": """scene = {
    "chain": {
        "nodes": 1,
        "mass": 0.01,
        "stiffness": 4e4,
        "damping": {"mass": 40},
        "spacing": 0.1,
        "expansion": 2.4e-5,
        "heat_capacity": 0.2,
        "conductance": 1.1,
        "convection": 0.4,
        "heating": 2,
    },
    "casing": {"gap": "70 um"},
    "load": {"amplitude": 10, "frequency": 668.45},
    "initial": {"displacement": "-160.51 um", "velocity": -0.14957, "temperature": 107.81},
    "duration": 1,
}
axes = {"scheme": "event_driven", "e": 0.4, "alpha": {"boundary": [20, 0, 40]}}
axes["scene.casing.gap"] = {"branch": ["70 um", "160 um", 24]}
study = read_study({"study": "folds", "scene": scene, "axes": axes, "output": {"steady": {"periods": 1}}})
figure = boundary(run_study(study, directory + "/folds.nc").dataset)""",
    "interaction_map": """scene = {
    "modes": {"table": [[420, 0.01, 9.0], [1310, 0.01, 9.5]]},
    "casing": {"gap": "100 um", "harmonics": [{"order": 4, "amplitude": "92 um"}, {"order": 9, "amplitude": "10 um"}]},
    "duration": 0.4,
}
axes = {"scheme": "event_driven", "e": 0, "scene.speed": {"lin": ["3000 rpm", "12000 rpm", 61]}}
output = {"interval": "0.2 ms", "histories": ["displacement"]}
study = read_study({"study": "map", "scene": scene, "axes": axes, "output": output})
figure = interaction_map(run_study(study, directory + "/map.nc").dataset, "displacement", study=study)""",
    "campbell": """spin = {"scene.blade.spin": {"radius": "0.25 m"}, "scene.speed": "120000 rpm"}
figure = campbell(read_study("blade.yaml").with_(spin), orders=[1, 2, 3, 6])""",
    "clearance": """turning = {"scene.blade.spin.radius": 0.25, "scene.casing.gap": "36 um", "scene.initial": "static"}
axes = {"scheme": "event_driven", "alpha": 0.5, "scene.speed": {"lin": ["60 rpm", "1500 rpm", 40]}}
study = read_study("blade.yaml").with_({**turning, "axes": axes})
figure = clearance(run_study(study, directory + "/speeds.nc").dataset)""",
    "wear_map": """rod = {"nodes": 3, "mass": 2e-3, "stiffness": 4e6, "spacing": 5e-3, "damping": {"ratio": 0.05}}
heat = {"expansion": 4e-5, "heat_capacity": 0.4, "conductance": 0.5, "convection": 0.02}
scene = {
    "chain": rod | heat,
    "casing": {
        "gap": "6 um",
        "flexibility": 1e-7,
        "coating": {"yield_force": 2, "hardening": 2e5, "sectors": 90},
        "harmonics": [{"order": 2, "amplitude": "8 um"}, {"order": 5, "amplitude": "2 um"}],
    },
    "speed": "3000 rpm",
    "load": {"mean": 4},
    "duration": 2,
}
axes = {"scheme": "moreau", "h": 5e-5, "alpha": 4}
output = {"interval": "10 ms", "wear": {"every": 1}, "balances": False}
study = read_study({"study": "worn", "scene": scene, "axes": axes, "output": output})
figure = wear_map(run_study(study, directory + "/worn.nc").dataset)""",
}
"""What draws an example of each figure, in the directory of this file."""


def figure_section() -> Iterator[str]:
    """Yield the lines on the figures that Python draws."""
    yield "## Figures for papers"
    yield ""
    yield (
        "Functions of `workflow.plots` take a dataset, an archive or what is selected of one, and return a Matplotlib "
        '`Figure`: `figure.savefig("rub.pdf")`, `figure.set_size_inches(6.3, 6)`, `figure.axes[0].set_ylim(0, 30)`.'
    )
    yield ""
    for name, code in FIGURES.items():
        function = getattr(plots, name)
        about, _, rest = str(inspect.getdoc(function)).partition("\n\nParameters")
        arguments = [line for line in rest.partition("\n\nRaises")[0].splitlines()[2:] if line.strip()]
        signature = ", ".join(
            str(p).partition(":")[0] + (f"={p.default}" if p.default is not p.empty else "")
            for p in inspect.signature(function).parameters.values()
        )
        yield f"### `{name}({signature})`"
        yield ""
        yield about.replace("``", "`").replace(":func:", "")
        yield ""
        for line in arguments:
            yield (
                f"  {line.strip()}".replace("``", "`").replace(":func:", "")
                if line.startswith(" ")
                else f"- `{line.replace(', ', '`, `')}`:"
            )
        yield ""
        yield f"```python\n{code}\n```"
        yield ""
        yield f"![Example of {name}](figures/{name}.png)"
        yield ""


def drawn(name: str) -> Figure:
    """Return the example of a figure."""
    import workflow

    with TemporaryDirectory() as directory, contextlib.chdir(FILE.parent):
        known = {"directory": directory, name: getattr(plots, name)}
        known |= {one: getattr(workflow, one) for one in ("open_archive", "read_study", "run_study")}
        exec(FIGURES[name], known)
        figure = known["figure"]
        assert isinstance(figure, Figure)
        figure.draw_without_rendering()
        return figure


def text() -> str:
    """Return the whole reference."""
    return "\n".join([HEAD, *key_tables(), *variable_table(), *figure_section()]).rstrip() + "\n"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
    for name in FIGURES:
        figure = drawn(name)
        figure.savefig(FILE.with_name("figures") / f"{name}.png", dpi=80)
