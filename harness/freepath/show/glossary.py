"""The words of freepath, each with one meaning: for `freepath explain` and docs/glossary.md."""

from __future__ import annotations

from freepath.errors import NothingMatchedError, did_you_mean

WORDS = {
    "case": "One combination of the axes of a config: a tracker, in a medium, with a majorant. A "
    "row of summary.csv.",
    "tracker": "A way to sample the distance to a collision, or to estimate transmittance: delta "
    "tracking, ratio tracking, marching, ...",
    "round": "The same number of samples of every ray of a case, taken at once and timed together. "
    "Rounds of different cases take turns, so a machine that drifts slows all alike. A row of "
    "samples.csv.",
    "unit": "A block of samples of one ray: what a lane takes next when it is free.",
    "lane": "One of the paths that a work-item follows at once, in an element of a vector. A CPU "
    "usually has 4 to 16, a GPU 1.",
    "flight": "A path from its start to its first collision, or to where it leaves the medium.",
    "sample": "One random path of a ray, and the score that it gives.",
    "lookup": "One evaluation of the extinction at a point. It is what most papers count; it is "
    "not time.",
    "crossing": "A step over the border of a cell of the majorant, or of the medium in regular "
    "tracking. Counted apart from lookups.",
    "tentative collision": "A point sampled as if the majorant were the extinction. The tracker "
    "then decides whether the collision is real or null.",
    "majorant": "An upper bound of the extinction in a region: the whole medium (global), or each "
    "cell of a grid or an octree.",
    "tightness": "The majorant over the largest extinction of its region. 1 is tight; more is "
    "looser, and 4 is four times too large; below 1 it does not bound.",
    "control": "The homogeneous part that decomposition and residual ratio tracking split off.",
    "occupancy": "The share of lanes that are at work, over all steps: what divergence leaves of "
    "them.",
    "bias": "The error that remains however many samples are taken. Tables show the mean over "
    "rays. The root mean square (RMS) over rays, in brackets, decides the time to an accuracy.",
    "variance": "Of one sample, for each ray, averaged over rays. Tables divide it by the squared "
    "reference.",
    "time to 1 %": "Device time per ray until the RMSE is 1 % of the reference, by "
    "RMSE(t)^2 = bias^2 + variance x time_per_sample / t.",
    "baseline": "The case that ratios are of: delta tracking with one majorant at tightness 1, or "
    "what --baseline names.",
    "not known": "What the measurement does not settle: its interval is too wide to judge by. It "
    "never ranks as if it were good.",
    "reference": "The exact value, by a closed form or in float64.",
    "estimand": "What a case estimates: transmittance, free_path, radiance, ...",
}


def explain(word: str) -> str:
    """The meaning of a word; raises NothingMatchedError with a guess where it is none of these."""
    wanted = " ".join(word.lower().replace("_", " ").split())
    if wanted not in WORDS:
        near = did_you_mean(wanted, WORDS)
        known = ", ".join(WORDS)
        raise NothingMatchedError(f"no word '{word}' in the glossary{near}; there are: {known}")
    return WORDS[wanted]


def markdown() -> str:
    """The page docs/glossary.md."""
    head = "# Glossary\n\nWhat the words of tables and docs mean, one meaning a word. "
    head += "`freepath explain WORD` says it in the terminal.\n"
    return head + "".join(f"\n**{word}**: {text}\n" for word, text in WORDS.items())
