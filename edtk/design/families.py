"""Families of responses with their links: what an experiment tells of a predictor."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import expit, ndtr

from edtk.system.errors import ArgumentError
from edtk.system.typing import Array, Mask


@dataclass(frozen=True)
class Link:
    """How the mean of a response follows from the predictor eta.

    Attributes:
        name: Its name, that of statistics.
        mean: ``mu(eta)``.
        complement: ``1 - mu(eta)``, without the digits that a difference loses.
        slope: ``d mu / d eta``.
    """

    name: str
    mean: Callable[[Array], Array]
    complement: Callable[[Array], Array]
    slope: Callable[[Array], Array]


LINKS = {
    link.name: link
    for link in (
        Link("identity", lambda eta: eta, lambda eta: 1 - eta, np.ones_like),
        Link("log", np.exp, lambda eta: -np.expm1(eta), np.exp),
        Link("inverse", lambda eta: 1 / eta, lambda eta: (eta - 1) / eta, lambda eta: -1 / eta**2),
        Link("logit", expit, lambda eta: expit(-eta), lambda eta: expit(eta) * expit(-eta)),
        Link(
            "probit",
            ndtr,
            lambda eta: ndtr(-eta),
            lambda eta: np.exp(-np.square(eta) / 2) / np.sqrt(2 * np.pi),
        ),
        Link(
            "cloglog",
            lambda eta: -np.expm1(-np.exp(eta)),
            lambda eta: np.exp(-np.exp(eta)),
            lambda eta: np.exp(eta - np.exp(eta)),
        ),
    )
}


def _divergence(a: Array, b: Array) -> Array:
    """``a log(a/b) - a + b``, with all digits where both are alike."""
    excess = (b - a) / a
    return np.asarray(a * (excess - np.log1p(excess)))


@dataclass(frozen=True)
class Family:
    """The distribution of a response about its mean.

    Attributes:
        name: Its name.
        default: The link that is taken where none is given.
        links: Names of the links that make sense with it.
        variance: ``V(mu)`` from mu and 1 - mu.
        deviance: ``2 KL(mu || nu)`` of the distribution of mean nu from that of mean mu, of sigma
            one: from mu, 1 - mu, nu and 1 - nu.
        holds: Which means (mu, 1 - mu) the family can have.
        range: These means in words.
    """

    name: str
    default: str
    links: tuple[str, ...]
    variance: Callable[[Array, Array], Array]
    deviance: Callable[[Array, Array, Array, Array], Array]
    holds: Callable[[Array, Array], Mask]
    range: str


FAMILIES = {
    family.name: family
    for family in (
        Family(
            "normal",
            "identity",
            ("identity", "log", "inverse"),
            lambda mean, rest: np.ones_like(mean),
            lambda mean, rest, other, left: np.square(mean - other),
            lambda mean, rest: np.isfinite(mean),
            "finite",
        ),
        Family(
            "binomial",
            "logit",
            ("logit", "probit", "cloglog", "log", "identity"),
            lambda mean, rest: mean * rest,
            lambda mean, rest, other, left: (
                2 * (_divergence(mean, other) + _divergence(rest, left))
            ),
            lambda mean, rest: (mean > 0) & (rest > 0),
            "between 0 and 1",
        ),
        Family(
            "Poisson",
            "log",
            ("log", "identity"),
            lambda mean, rest: mean,
            lambda mean, rest, other, left: 2 * _divergence(mean, other),
            lambda mean, rest: mean > 0,
            "positive",
        ),
        Family(
            "gamma",
            "log",
            ("log", "inverse", "identity"),
            lambda mean, rest: np.square(mean),
            lambda mean, rest, other, left: 2 * _divergence(np.ones_like(mean), mean / other),
            lambda mean, rest: mean > 0,
            "positive",
        ),
    )
}


# Roots of weights in closed form: quick, smooth, and of no rounding at the ends.
CLOSED: dict[tuple[str, str], Callable[[Array], Array]] = {
    ("binomial", "logit"): lambda eta: 0.5 / np.cosh(eta / 2),
    ("Poisson", "log"): lambda eta: np.exp(eta / 2),
    ("gamma", "log"): lambda eta: 0.0 * eta + 1.0,
}


@dataclass(frozen=True)
class Response:
    """A family with a link.

    Attributes:
        family: The family.
        link: The link.
    """

    family: Family
    link: Link

    @classmethod
    def of(cls, family: str, link: str | None) -> "Response":
        """The family and its link by their names.

        Raises:
            ArgumentError: There is no such family, or it has no such link.
        """
        by_name = {name.lower(): each for name, each in FAMILIES.items()}
        found = by_name.get(str(family).lower())
        if found is None:
            message = f"expected one of {', '.join(FAMILIES)}"
            raise ArgumentError(message, argument="family", given=family)
        name = found.default if link is None else str(link)
        if name not in found.links:
            message = f"expected one of {', '.join(found.links)} for family {found.name}"
            raise ArgumentError(message, argument="link", given=link)
        return cls(found, LINKS[name])

    @property
    def is_plain(self) -> bool:
        """Whether the predictor is the mean, and its errors are alike."""
        return self.family.name == "normal" and self.link.name == "identity"

    def root_weights(self, eta: Array) -> Array:
        """``mu'(eta) / sqrt(V(mu))`` of predictors eta: the root of their information.

        The information of a generalised linear model about eta is ``mu'^2 / V(mu)`` (McCullagh and
        Nelder, Generalized Linear Models, 1989, section 2.5). It is zero where the square of the
        slope is none, and not a number where the family cannot have the mean.
        """
        closed = CLOSED.get((self.family.name, self.link.name))
        with np.errstate(all="ignore"):
            if closed is not None:
                return closed(eta)
            mean, rest = self.link.mean(eta), self.link.complement(eta)
            slope = self.link.slope(eta)
            found = slope / np.sqrt(self.family.variance(mean, rest))
        fades = (np.square(slope) == 0) & np.isfinite(eta)  # 1 - mu has then no digits left
        return np.where(fades, 0.0, np.where(self.family.holds(mean, rest), found, np.nan))

    def deviance_roots(self, eta: Array, other: Array) -> Array:
        """Roots of ``2 KL`` of means at predictors `other` from those at `eta`, with their sign.

        For normal responses it is the difference of the means. KL is the divergence of Kullback and
        Leibler, by which Lopez-Fidalgo, Tommasi and Trandafir (JRSS B 69, 2007) discriminate; not a
        number where the family cannot have a mean.
        """
        with np.errstate(all="ignore"):
            own = self.link.mean(eta), self.link.complement(eta)
            their = self.link.mean(other), self.link.complement(other)
            roots = np.sqrt(np.maximum(self.family.deviance(*own, *their), 0.0))
        holds = self.family.holds(*own) & self.family.holds(*their)
        return np.where(holds, np.sign(own[0] - their[0]) * roots, np.nan)
