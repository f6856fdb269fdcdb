"""Command lines that are valid, and mutations of their options."""

from random import Random

import click

from edtk.cli import main
from tests.fuzz import nasty

Words = list[str]

EVALUATE = "evaluate study.toml plan.csv"
TEMPLATE = "template study.toml plan.csv"
IDENTIFY = "identify study.toml sheet.csv"
COMPENSATE = "compensate study.toml k.json task.csv"
BIAS = "bias study.toml plan.csv"
VERIFY = "verify certificate.json"
RELAX = "relax study.toml"
PLAN = "plan study.toml --size 2 --distinct 1 --workers 1"
RUN = "run study.toml --workers 1 --out out"
BAYES = "bayes study.toml plan.csv --accuracy 0.5 --most 2000"
CRITERIA = "criteria"
ROBOT = "robot robot.urdf --tip flange"
NEW = "new --robot robot.urdf --tip flange --out new.toml"
CONTROLLER = "controller robot.urdf positions.csv --tip flange"
VISITS = "plan study.toml --size 8 --budget 0.1"
DAY = "plan study.toml --cost-budget 15 --budget 0.1"
PREDICT = "predict study.toml result.json tests.csv"
PREDICT_K = "predict study.toml k.json plan.csv"
CORRECT = "compensate study.toml result.json poses.csv"
VERBS = tuple(sorted(main.commands))

# Words that may be added to each command; those that take long are left to the long campaign.
EXTRAS = {
    "evaluate": ("--json",),
    "template": ("--positions", "--markers 2", "--out new.csv"),
    "identify": ("--json", "--robust", "--sigma-unknown", "--plan plan.csv"),
    "compensate": ("--json", "--out new.csv"),
    "bias": ("--json",),
    "verify": ("--json", "--study study.toml"),
    "relax": ("--json", "--out new.csv", "--certificate new.json", "--seed 3"),
    "plan": ("--json", "--out new.csv", "--keep keep.csv --rest rest.csv", "--exclude exclude.csv"),
    "run": ("--fresh",),
    "bayes": ("--json", "--nu normal", "--sigma-factor 1", "--seed 3"),
    "criteria": ("--json",),
    "robot": ("--json", "--base base"),
    "new": ("--force",),
    "controller": ("--json",),
    "predict": ("--json", "--out new.csv"),
}
LONG_EXTRAS = {
    "identify": (
        "--out out",
        "--bayes --accuracy 0.5 --most 2000",
        "--bayes --accuracy 0.5 --most 2000 --chain new.h5",
    ),
    "relax": ("--continuous", "--criterion A"),
    "plan": ("--criterion A", "--certificate new.json", "--budget 0.1"),
    "bayes": ("--chain new.h5", "--nu sampled", "--sigma-factor inf", "--figures out"),
}
# Options that import what takes a second to import.
LONG = ("--dask", "--figures", "--export")
# Options whose values start processes or look for other machines.
CAREFUL = ("--workers", "--dask")
HARMLESS = {
    "--workers": ("0", "-1", "1", "1.5", "nan", "", "x", "1e3", "9" * 5000),
    "--dask": ("", "x", "tcp://", "tcp://127.0.0.1:1", "tcp://127.0.0.1:99999", "é", "http://a b"),
}

UNKNOWN = ("--unknown", "--outt", "-x", "--", "--json=1", "-h", "--version", "extra", "--out=")


def with_extras(line: str, rng: Random, long: bool) -> Words:
    """A valid command line with some of the options that its command has."""
    words = line.split()
    verb = words[0]
    for extra in EXTRAS[verb]:
        if rng.random() < 0.35:
            words += extra.split()
    for extra in LONG_EXTRAS.get(verb, ()):
        if long and rng.random() < 0.08:
            words += extra.split()
    return words


def mutate_options(words: Words, rng: Random, long: bool) -> Words:
    """Another value of an option, or options that are missing, twice, unknown or misplaced."""
    way = rng.random()
    if way < 0.65:
        return _set_option(words, rng, long)
    if way < 0.8:
        return mutate_path(words, rng)
    found = words[:]
    place = rng.randrange(1, len(found) + 1)
    if way < 0.85 and place < len(found):
        del found[place]
    elif way < 0.9:
        found.insert(place, rng.choice(found))
    elif way < 0.95:
        found.insert(place, rng.choice(UNKNOWN))
    else:
        found[rng.randrange(len(found))] = nasty.text(rng)
    return found


def mutate_path(words: Words, rng: Random) -> Words:
    """Another path in place of one that is read or written."""
    places = [i for i, word in enumerate(words) if i > 0 and "." in word and word[0].isalpha()]
    places += [i for i, word in enumerate(words) if word == "out"]
    if not places:
        return words
    found = words[:]
    found[rng.choice(places)] = nasty.path(rng)
    return found


def _set_option(words: Words, rng: Random, long: bool) -> Words:
    """One of the command's options with a nasty value, in place of its own or at the end."""
    verb = words[0] if words[0] in VERBS else rng.choice(VERBS)
    every = [p for p in main.commands[verb].params if isinstance(p, click.Option)]
    usable = [option for option in every if long or option.opts[0] not in LONG]
    option = rng.choice(usable)
    name = option.opts[0]
    found = words[:]
    if option.is_flag:
        return [*found, name, *([rng.choice(("", "1", "true"))] if rng.random() < 0.2 else [])]
    value = _value(option, rng)
    if name in found and found.index(name) + 1 < len(found):
        found[found.index(name) + 1] = value
        return found
    return [*found, f"{name}={value}"] if rng.random() < 0.1 else [*found, name, value]


def _value(option: click.Option, rng: Random) -> str:
    """A nasty value of an option, as its type has it."""
    name = option.opts[0]
    if name in CAREFUL:
        return rng.choice(HARMLESS[name])
    if isinstance(option.type, click.Path):
        return nasty.path(rng)
    numeric = option.type.name in ("integer", "float", "number")
    if numeric or rng.random() < 0.5:
        return nasty.number(rng) if rng.random() < 0.9 else nasty.text(rng)
    return nasty.text(rng)
