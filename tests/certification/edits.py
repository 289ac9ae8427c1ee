"""Files of certificates, and ways to change them, for the tests of their checker."""

import copy

from starhold.certification.certificate import write
from starhold.checker import check, check_file


def checked(certificate, folder):
    """What the checker finds in the file of a certificate."""
    write([certificate], "made", folder / "certificate.json")
    return check_file(folder / "certificate.json")


def claims_of(content):
    """The claims of the first certificate by their kinds."""
    return {claim["kind"]: claim for claim in content["certificates"][0]["claims"]}


def alone(content, kind):
    """The content with one claim that has no proof of the kernel, which is enough to see whether that claim fails."""
    certificate = content["certificates"][0]
    claim = claims_of(content)[kind]
    # The linear loop alone proves nothing of where the motion ends.
    outcome = "undecided" if (kind, claim["outcome"]) == ("sampling", "proved") else claim["outcome"]
    subject = certificate["subject"]
    if kind != "sliding" and "disturbance" in subject:
        subject = {**subject, "disturbance": 0.0}
    one = {**certificate, "outcome": outcome, "subject": subject, "claims": [claim]}
    return with_kinds({**content, "certificates": [one], "claims": [], "programs": {}})


def with_kinds(content):
    """The content with the list of the claims that are there."""
    for certificate in content["certificates"]:
        certificate["kinds"] = [claim["kind"] for claim in certificate["claims"]]
    return content


def edited(content, place, value):
    """The content with another value in the claim of a kind, or, without one, in the subject."""
    changed = copy.deepcopy(content)
    kind, *path = place
    spot = claims_of(changed)[kind] if kind else changed["certificates"][0]["subject"]
    for key in path[:-1]:
        spot = spot[key]
    spot[path[-1]] = value
    return changed


def spots(value, path=()):
    """The paths of all values in a file."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from spots(inner, (*path, key))


def content_at(content, path):
    """The value at a path."""
    for key in path:
        content = content[key]
    return content


def replaced(content, path, change):
    """The content after a change at a path, made of the object or list that holds it and the key."""
    changed = copy.deepcopy(content)
    spot = changed
    for key in path[:-1]:
        spot = spot[key]
    change(spot, path[-1])
    return changed


def changed(content, place, value):
    """The content with another value at a place."""
    return replaced(content, place, lambda spot, key: spot.__setitem__(key, value))


def outcomes(content):
    """Kinds of claims to their outcomes."""
    return {claim["kind"]: claim["outcome"] for claim in content["certificates"][0]["claims"]}


def reasons(content):
    """Why something in a file fails."""
    return [finding.reason for finding in check(content) if finding.verdict == "fails"]


def faults(content):
    """Claim and obligation to the reason why it fails."""
    return {(f.claim, f.obligation): f.reason for f in check(content) if f.verdict == "fails"}


def lists_are_exact(content, place, wrong):
    """No obligation nor assumption of the claim at a place can be left out, told twice, moved to the end or changed; `wrong`
    gives values that no obligation has."""
    claim = content_at(content, place)
    for part in ("obligations", "assumptions"):
        listed = claim[part]
        for k, item in enumerate(listed):
            less = [*listed[:k], *listed[k + 1 :]]
            assert faults(changed(content, (*place, part), less))
            assert faults(changed(content, (*place, part), [*listed, item]))
            assert faults(changed(content, (*place, part), [*less, item])) or k == len(listed) - 1
            spoilt = [{**item, key: value} for key, value in wrong.items()] if part == "obligations" else ["position known"]
            for value in spoilt:
                assert faults(changed(content, (*place, part, k), value)), value


def holds_unrefuted(content, place, names):
    """Of a claim that holds no obligation is taken for refuted."""
    for k, name in enumerate(names):
        wrong = changed(content, ("certificates", 0, "claims", place, "obligations", k, "outcome"), "refuted")
        wrong["certificates"][0]["outcome"] = wrong["certificates"][0]["claims"][place]["outcome"] = "refuted"
        assert [finding.obligation for finding in check(wrong) if finding.verdict == "fails"] == [name]
