"""Claims about a body and a law made by hand, for the kernel."""

from starhold.algebra.quaternion import derivative, vector_part
from starhold.algebra.vector import scale, subtract
from starhold.certification.evidence.recorded import ASKED, FULL, Q4, V3
from starhold.kernel.programs import digest
from starhold.parts.bodies.rigid_body import angular_acceleration, kinetic_energy
from starhold.parts.craft import Craft
from starhold.trace.straight_line import straight_line

PLANT = Craft(FULL, FULL, 1.0, 1.0)
C, K = 0.4, 0.1


def feedback(damping=C, stiffness=K):
    return lambda m: subtract(scale(-damping, m.rate), scale(stiffness, vector_part(m.attitude)))


def energy(kinetic=1.0, stiffness=K):
    return lambda m, craft: kinetic * kinetic_energy(m.rate, craft) + 2.0 * stiffness * (1.0 - m.attitude[0])


def case(law=None, V=None, theorem="converges", taken=(), J=(1.0,) * 3, s=None, **more):
    """A claim and its programs."""
    body, turning = more.pop("body", angular_acceleration), more.pop("turning", derivative)
    programs = {
        "law": straight_line(law or feedback(), measurement=ASKED),
        "body": straight_line(body, rate=V3, torque=V3, craft=PLANT),
        "turning": straight_line(turning, q=Q4, rate=V3),
    }
    if theorem.startswith(("converges", "points")):
        programs["lyapunov"] = straight_line(V or energy(), measurement=ASKED, craft=PLANT)
    if s is not None:
        programs["surface"] = straight_line(s, measurement=ASKED)
    subject = {f"body.inertia.{i}.{k}": str(int(J[i]) if i == k else 0) for i in range(3) for k in range(i, 3)}
    told = {name.replace("_", "."): x if isinstance(x, str) else float(x).hex() for name, x in more.items()}
    claim = {"theorem": theorem, "taken": list(taken), "programs": {role: digest(p) for role, p in programs.items()},
             "subject": {} if "whatever" in theorem else subject, "numbers": told, "evidence": {}}  # fmt: skip
    return claim, {digest(p): p for p in programs.values()}
