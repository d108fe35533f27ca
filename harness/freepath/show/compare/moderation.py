"""Variances of few runs, steadied by those of their neighbours.

Three runs per side show the variance of a case's change badly, but cases of a scene vary much alike
from run to run. Smyth 2004 (Linear models and empirical Bayes methods for assessing differential
expression) takes the true variances for draws from a scaled inverse chi-square, whose two
parameters the spread of the estimates tells: where they differ by no more than chance, all share
one variance; where they differ by more, each keeps its own.
"""

from __future__ import annotations

import numpy as np
from scipy import optimize, special

LEAST = 4
"""Cases from which the spread of their variances can be told."""
WIDEST = 1e6
"""Degrees of freedom that stand for no spread beyond chance."""


def moderated(variances: np.ndarray, freedoms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variances (cases,) and their degrees of freedom, each with what all of them tell."""
    known = (variances > 0) & (freedoms > 0)
    if known.sum() < LEAST:
        return variances, freedoms
    half = freedoms[known] / 2
    logs = np.log(variances[known]) - special.digamma(half) + np.log(half)
    spread = float(logs.var(ddof=1) - special.polygamma(1, half).mean())
    prior = _freedom_of(spread)
    level = np.exp(logs.mean() + special.digamma(prior / 2) - np.log(prior / 2))
    shared = (prior * level + freedoms * variances) / (prior + freedoms)
    return shared, np.minimum(prior + freedoms, freedoms[known].sum())


def _freedom_of(spread: float) -> float:
    """Degrees of freedom whose log variance has so much variance: trigamma(d / 2), inverted."""
    if spread <= float(special.polygamma(1, WIDEST / 2)):
        return WIDEST
    least = 1e-6
    if spread >= float(special.polygamma(1, least / 2)):
        return least
    return float(optimize.brentq(lambda d: special.polygamma(1, d / 2) - spread, least, WIDEST))
