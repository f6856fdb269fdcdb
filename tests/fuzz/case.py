"""One case by its number: a command line, and the files on which it is run."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random

from tests.fuzz import command_lines as lines
from tests.fuzz import days_world
from tests.fuzz.command_lines import mutate_options, mutate_path, with_extras
from tests.fuzz.mutate_chain import mutate_chain
from tests.fuzz.mutate_table import mutate_table
from tests.fuzz.mutate_text import OF_BYTES, OF_TEXT
from tests.fuzz.mutate_tree import mutate_json, mutate_toml
from tests.fuzz.worlds import ANY, DAYS, FIRST, FULL_POSES, GEOMETRY, MIX, OF_TABLES, WRITTEN, Files

Mutate = Callable[[bytes, Random], bytes]

MOST_CANDIDATES = 1e9  # that a study may ask for; it may take a day
CANDIDATES = re.compile(rb'(candidates"? *= *)([0-9]+(?:\.[0-9]+)?(?:e[0-9]{1,3})?)')
SHORT = 2000  # numbers below this are those of `make test`, and leave out whatever takes long


@dataclass(frozen=True)
class Kind:
    """A kind of input, and the commands that read it.

    Attributes:
        files: Names of the files, or the beginnings of their names.
        readers: Command lines that read them; those that come often stand here more than once.
        mutate: How files of this kind are mutated besides their bytes and words; None for files
            that are no text.
        worlds: Where there are such files.
        share: Cases of this kind, relative to those of others.
        slow: Whether its commands take so long that `make test` has few of these cases.
    """

    files: tuple[str, ...]
    readers: tuple[str, ...]
    mutate: Mutate | None = None
    worlds: tuple[str, ...] = tuple(WRITTEN)
    share: int = 4
    slow: bool = False


CHEAP = (lines.EVALUATE, lines.TEMPLATE, lines.BIAS, lines.COMPENSATE, lines.IDENTIFY)
OF_GEOMETRY = (lines.RELAX, lines.EVALUATE, lines.TEMPLATE, lines.VISITS, lines.DAY)
READ_STUDY = (*CHEAP * 4, *(lines.RELAX, lines.BAYES) * 2, lines.PLAN, lines.RUN)
READ_PLAN = (*(lines.EVALUATE, lines.TEMPLATE, lines.BIAS) * 3, f"{lines.IDENTIFY} --plan plan.csv")
SLOW = (lines.PLAN, lines.RUN, lines.VISITS, lines.DAY)
CHAIN = f"{lines.BAYES} --chain chain.h5"
KINDS = {
    "study": Kind(("study.toml",), READ_STUDY, mutate_toml, share=16),
    "robot": Kind(("robot.toml",), READ_STUDY, mutate_toml, OF_TABLES, share=10),
    "urdf": Kind(
        ("robot.urdf",), (*READ_STUDY, *(lines.ROBOT, lines.NEW) * 6), None, (ANY,), share=8
    ),
    "positions": Kind(("positions.csv",), (lines.CONTROLLER,), mutate_table, (ANY,), share=3),
    "plan": Kind(("plan.csv",), (*READ_PLAN, lines.BAYES), mutate_table, share=10),
    "sheet": Kind(("sheet.csv",), (lines.IDENTIFY,), mutate_table, share=14),
    "k": Kind(("k.json",), (lines.COMPENSATE,), mutate_json, share=8),
    "task": Kind(("task.csv",), (lines.COMPENSATE,), mutate_table, share=8),
    "certificate": Kind(("certificate.json",), (lines.VERIFY,), mutate_json, share=8),
    "certificate of a plan": Kind(
        ("planned.json",), ("verify planned.json",), mutate_json, (FIRST,), share=4
    ),
    "checkpoint": Kind(
        ("run/cases/",), ("run study.toml --workers 1 --out run",), mutate_json, (FIRST,), 2, True
    ),
    "chain": Kind(("chain.h5",), (CHAIN,), mutate_chain, (FIRST,), share=4),
    "published plan": Kind(("pub.csv",), (lines.RUN,), mutate_table, ("arm", "pose"), 3, True),
    "kept plan": Kind(("keep.csv",), (f"{lines.PLAN} --keep keep.csv",), mutate_table, slow=True),
    "excluded plan": Kind(
        ("exclude.csv",), (f"{lines.PLAN} --exclude exclude.csv",), mutate_table, slow=True
    ),
    "excluded plan of a study": Kind(
        ("exclude.csv",), (*CHEAP, lines.RELAX), mutate_table, ("pose",), share=2
    ),
    "prior": Kind(("earlier.json",), (lines.BAYES,), mutate_json, ("pose",), slow=True),
    "options": Kind(
        (), (*CHEAP * 3, lines.VERIFY, lines.RELAX, lines.BAYES, lines.CRITERIA), share=14
    ),
    "options of robots": Kind((), (lines.ROBOT, lines.NEW, lines.CONTROLLER), None, (ANY,)),
    "options of searches": Kind((), (lines.PLAN, lines.RUN, lines.RELAX, CHAIN), slow=True),
    "study of geometry": Kind(
        ("study.toml", "robot.toml"),
        (*(lines.PREDICT, lines.IDENTIFY) * 3, *CHEAP, *OF_GEOMETRY, lines.PLAN, lines.RUN),
        mutate_toml,
        (GEOMETRY,),
    ),
    "plan of geometry": Kind(
        ("plan.csv",), (lines.EVALUATE, lines.TEMPLATE), mutate_table, (GEOMETRY,), share=2
    ),
    "kept visits": Kind(
        ("plan.csv",), (f"{lines.VISITS} --keep plan.csv",), mutate_table, (GEOMETRY,), slow=True
    ),
    "sheet of positions": Kind(("sheet.csv",), (lines.IDENTIFY,), mutate_table, (GEOMETRY,)),
    "result of geometry": Kind(("result.json",), (lines.PREDICT,), mutate_json, (GEOMETRY,)),
    "poses to predict": Kind(("tests.csv",), (lines.PREDICT,), mutate_table, (GEOMETRY,)),
    "options of geometry": Kind(
        (), (lines.PREDICT, lines.IDENTIFY, *OF_GEOMETRY), None, (GEOMETRY,), share=2
    ),
    "paths": Kind((), (*CHEAP * 3, lines.VERIFY, lines.RELAX, lines.BAYES, lines.RUN), share=6),
}
READ_RESULT = (lines.PREDICT, lines.CORRECT)
READ_POSES = (*(lines.PREDICT, lines.IDENTIFY) * 3, lines.EVALUATE, lines.TEMPLATE, lines.CORRECT)
POSTERIOR = f"{lines.IDENTIFY} --bayes"
PROGRAMS = {
    name: f"compensate study.toml k.json {name} --out new{Path(name).suffix}"
    for name in days_world.PROGRAMS
}
READ_DAYS = (*CHEAP * 2, *PROGRAMS.values(), lines.PREDICT_K, lines.RELAX, lines.DAY)
# Kinds that came later have numbers of their own, so that all others mean what they meant.
EVERY = 9
LATER = {
    "study of a mix": Kind(("study.toml", "robot.toml"), READ_STUDY, mutate_toml, (MIX,), share=8),
    "plan of a mix": Kind(("plan.csv",), READ_PLAN, mutate_table, (MIX,)),
    "sheet of a mix": Kind(("sheet.csv",), (lines.IDENTIFY,), mutate_table, (MIX,), share=8),
    "certificate of a mix": Kind(
        ("certificate.json",), (lines.VERIFY,), mutate_json, (MIX,), share=2
    ),
    "options of a mix": Kind((), (*CHEAP, lines.RELAX, lines.BAYES), None, (MIX,)),
    "study of full poses": Kind(
        ("study.toml", "robot.toml"),
        (*READ_POSES * 2, *OF_GEOMETRY, POSTERIOR),
        mutate_toml,
        (FULL_POSES,),
        share=8,
    ),
    "plan of full poses": Kind(
        ("plan.csv",), (lines.EVALUATE, lines.TEMPLATE), mutate_table, (FULL_POSES,)
    ),
    "kept visits of full poses": Kind(
        ("plan.csv",), (f"{lines.VISITS} --keep plan.csv",), mutate_table, (FULL_POSES,), slow=True
    ),
    "sheet of full poses": Kind(
        ("sheet.csv",), (*(lines.IDENTIFY,) * 5, POSTERIOR), mutate_table, (FULL_POSES,), share=8
    ),
    "result of full poses": Kind(("result.json",), READ_RESULT, mutate_json, (FULL_POSES,)),
    "poses of full poses": Kind(("tests.csv",), (lines.PREDICT,), mutate_table, (FULL_POSES,)),
    "poses to command": Kind(("poses.csv",), (lines.CORRECT,), mutate_table, (FULL_POSES,)),
    "options of full poses": Kind((), (*READ_POSES, *OF_GEOMETRY, POSTERIOR), None, (FULL_POSES,)),
    "study of days": Kind(("study.toml", "robot.toml"), READ_DAYS, mutate_toml, (DAYS,), share=8),
    "sheet of days": Kind(("sheet.csv",), (lines.IDENTIFY,), mutate_table, (DAYS,)),
    "kept visits of days": Kind(
        ("keep.csv",), (f"{lines.DAY} --keep keep.csv",), mutate_table, (DAYS,), slow=True
    ),
    "certificate of a day": Kind(
        ("day.json",),
        ("verify day.json", "verify day.json --study study.toml"),
        mutate_json,
        (DAYS, GEOMETRY),
        share=8,
    ),
    "certificate of an exact plan": Kind(
        ("exact.json",), ("verify exact.json",), mutate_json, (DAYS,)
    ),
    "options of days": Kind((), READ_DAYS, None, (DAYS,)),
    **{
        f"program {name}": Kind((name,), (line,), None, (DAYS,), share=2)
        for name, line in PROGRAMS.items()
    },
}


@dataclass(frozen=True)
class Case:
    """A command line, and the files that are not as they were.

    Attributes:
        number: From which everything else follows.
        kind: Name of the kind of input that is mutated.
        world: Name of the folder of valid files.
        words: The command line.
        changed: New contents of files, by name; None for a file that is missing.
    """

    number: int
    kind: str
    world: str
    words: tuple[str, ...]
    changed: dict[str, bytes | None]

    @property
    def verb(self) -> str:
        """The command, or "edtk" where it is misspelt."""
        return self.words[0] if self.words and self.words[0] in lines.VERBS else "edtk"

    @property
    def prints_a_file(self) -> bool:
        """Whether an output goes to standard output: `--out -` or `--out=-`."""
        return any(word == "-" or word.endswith("=-") for word in self.words)


def make_case(number: int, worlds: dict[str, Files]) -> Case:
    """The case of a number; the same on every machine, as long as the worlds are the same.

    Args:
        number: Any whole number that is not negative.
        worlds: The valid files of each world.
    """
    rng = Random(number)
    long = number >= SHORT
    name, kind = _kind(number, rng)
    world = rng.choice(kind.worlds)
    line = rng.choice(kind.readers)
    if not long and not kind.slow and line in SLOW and rng.random() < 0.8:
        line = lines.EVALUATE
    if world == ANY and line == lines.RUN:
        line = lines.RELAX  # a whole run with markers, noise and tasks takes five seconds
    words = with_extras(line, rng, long)
    changed: dict[str, bytes | None] = {}
    if name.startswith("options"):
        for _ in range(rng.choice((1, 1, 2))):
            words = mutate_options(words, rng, long)
    elif name == "paths":
        words = mutate_path(words, rng)
    else:
        valid = worlds[world]
        file = rng.choice([path for path in valid if path.startswith(kind.files)])
        changed[file] = _in_time(_mutated(valid[file], kind, rng))
    return Case(number, name, world, tuple(words), changed)


def kind_of(number: int) -> str:
    """Name of the kind of input that the case of a number has."""
    return _kind(number, Random(number))[0]


def _kind(number: int, rng: Random) -> tuple[str, Kind]:
    """A kind of input and its name."""
    kinds = LATER if number % EVERY == EVERY - 1 else KINDS
    slow = _slow_share(number >= SHORT)
    shares = [kind.share * (slow if kind.slow else 1.0) for kind in kinds.values()]
    name = rng.choices(list(kinds), shares)[0]
    return name, kinds[name]


def _slow_share(long: bool) -> float:
    """Part of the slow cases that are run: they would take half of the time."""
    return 0.4 if long else 0.1


def _in_time(content: bytes | None) -> bytes | None:
    """A file that asks for no more candidates than can be weighed in the time of a case."""
    if content is None:
        return None
    found = CANDIDATES.search(content)
    if found is None or not 1e5 < float(found[2]) <= MOST_CANDIDATES:
        return content
    return CANDIDATES.sub(rb"\g<1>50000", content)


def _mutated(content: bytes, kind: Kind, rng: Random) -> bytes | None:
    """A file that is missing, or of which entries, words or bytes are others."""
    way = rng.random()
    if way < 0.01:
        return None
    if kind.mutate is mutate_chain or (kind.mutate is not None and way < 0.5):
        return kind.mutate(content, rng)
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        content = rng.choice(OF_TEXT if way < 0.85 else OF_BYTES)(content, rng)
    return content
