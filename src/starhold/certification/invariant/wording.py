"""Certificates of invariant sets in sentences. Every number in them comes from the claim."""

from collections.abc import Mapping
from typing import Any

from starhold.certification.certificate import Claim, Obligation

HEADINGS = {
    "stable": "stable (theorem 1)",
    "attracts": "asymptotically stable (theorem 2)",
    "region": "region of attraction (theorem 2)",
    "unstable": "unstable (theorem 3)",
    "intersection": "region of attraction (theorem 4)",
    "avoids": "avoids an unsafe set",
}

OBLIGATIONS = {
    "proof": "the kernel accepts the evidence",
    "continuous": "V is continuous",
    "positive": "V > 0 everywhere in the box except at the equilibrium",
    "bounded": "V is above the level all over the border of the box, so that the set is compact and inside",
    "falls": "V is non-increasing on the set, and decreases except where a given function grows",
    "grows": "V grows wherever it is positive in the box",
    "start": "V is not positive in the start set, or is below the level there",
    "unsafe": "V is positive in the unsafe set",
    "barrier": "V' is at most V times a polynomial",
    "switching": "where the right-hand side jumps, V changes as it must for every mean there",
}


def sentence(claim: Claim) -> str:
    """Return the claim as a sentence, whether or not it is proved."""
    n = claim.numbers
    theorem, level = n["theorem"], n.get("level")
    where = "a level set of V" if level is None else f"{{V < {down(level)}}}"
    M = "the equilibrium" if claim.witness["equilibrium"] else "M"
    sense = ", in Filippov's sense," if len(claim.assumptions) > 1 else ""
    if theorem == "avoids":
        return f"no motion{sense} from the start set comes to the unsafe set" + " while it stays in the box" * n["within"]
    if theorem == "unstable":
        return f"{M} is unstable: every motion{sense} that starts in the box where V > 0 leaves the box"
    if theorem == "stable":
        return f"{M} is stable: no motion{sense} leaves {where}, nor any smaller level set"
    begin, stay = ("the start set", f"in {where}") if claim.witness["start"] else (where, "there")
    text = f"all motions{sense} that start in {begin} stay {stay} and come to"
    return f"{M} is asymptotically stable: {text} it" if theorem == "attracts" else f"{text} {M}"


def size(numbers: Mapping[str, Any], orbit: float | None = None) -> str:
    """How large the set is, and its share of what is known of the true region (`orbit`: the area inside of it)."""
    if "size" not in numbers:
        return ""
    share = numbers.get("known", orbit)
    text = f"its size is about {numbers['size']:.4g}, counted in floats"
    if share is not None:
        text += f": {100.0 * numbers['size'] / share:.1f} % of the true region's {share:.4g}"
        text += ", as the file tells" if "known" in numbers else ""
    return text


def limit(numbers: Mapping[str, Any]) -> str:
    """The bound of the level for this V, and why it is one."""
    if "refuted_level" not in numbers:
        return ""
    why = {"V rises": "where V does not decrease", "border": "on the border of the box"}[numbers["limited_by"]]
    return f"no level reaches {_up(numbers['refuted_level'])}: there is a state {why}"


def evidence(obligation: Obligation) -> str:
    """Return why an obligation is refuted or undecided."""
    parts: list[str] = []
    for key, value in obligation.evidence.items():
        if key == "reason":
            return str(value)
        if isinstance(value, dict):
            inside = ", ".join(f"{name} = {x:g}" for name, x in value.items())  # pyright: ignore
            parts.append(f"{key} ({inside})")
        elif isinstance(value, list):
            parts.append(f"{key}: {', '.join(str(x) for x in value)}")  # pyright: ignore
        else:
            parts.append(f"{key} = {value:.6g}" if isinstance(value, float) else f"{key} = {value}")
    return "; ".join(parts)


def down(value: float) -> str:
    """Four digits or six, not above the number."""
    text = f"{value:.6g}"
    return text if float(text) <= value else f"{value * (1.0 - 5e-6):.6g}"


def _up(value: float) -> str:
    text = f"{value:.6g}"
    return text if float(text) >= value else f"{value * (1.0 + 5e-6):.6g}"
