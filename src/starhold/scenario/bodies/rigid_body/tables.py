"""The tables of a rigid-body scenario as pydantic models. Each field has its units and bounds."""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import BeforeValidator, Field, model_validator

from starhold.laws.interface import Gain
from starhold.parts.as_built import MOUNTING
from starhold.parts.craft import check_inertia, heaviest
from starhold.parts.epoch import START
from starhold.parts.stated_attitude import check_attitude
from starhold.scenario.bodies.rigid_body.transient import TransientTable
from starhold.scenario.orbit import Orbit
from starhold.scenario.quantity import quantity, quantity_or, reader
from starhold.scenario.requirement import without_requirements
from starhold.scenario.schema import LawTable, ScenarioTable, SeededTiming
from starhold.scenario.tables import Flag, Table, at_key, refuse

MOST_RUNS = 100_000


class BudgetTable(Table):
    """How `starhold budget` samples pointing errors."""

    start: Annotated[
        float | None, *quantity(Gain("s", at_least=0.0, text="errors count from this time; half of the run if absent"))
    ] = None
    end: Annotated[
        float | None, *quantity(Gain("s", above=0.0, text="errors count until this time; the end of the run if absent"))
    ] = None
    window: Annotated[
        float | None, *quantity(Gain("s", above=0.0, text="length of windows; a tenth of the time counted if absent"))
    ] = None
    separation: Annotated[
        float | None,
        *quantity(Gain("s", above=0.0, text="time between a drift's two windows; half of the time counted if absent")),
    ] = None
    confidence: Annotated[
        float, *quantity(Gain("1", above=0.0, at_most=1.0, text="share of errors within the bound, such as 95 %"))
    ] = 0.9973
    interpretation: Annotated[
        Literal["mixed", "temporal", "ensemble"],
        Field(description="a share of all instants of all runs, of those of the worst run, or of runs at their worst"),
    ] = "mixed"
    runs: Annotated[
        int, *quantity(Gain("1", at_least=1, at_most=MOST_RUNS, whole=True, text="runs with different random numbers"))
    ] = 32
    boresight: Annotated[
        Any, *quantity(Gain("1", shape=(3,), spread=False, text="line of sight, body axes; all three axes if absent"))
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _without_requirements(cls, given: Any) -> Any:
        return without_requirements(given, "budget")

    @model_validator(mode="after")
    def _has_a_direction(self) -> Self:
        if self.boresight is not None and not any(self.boresight):
            raise at_key("boresight", "a direction that is not zero", list(self.boresight))
        return self


QUATERNION = Gain("1", shape=(4,), spread=False, text="quaternion, scalar first, normalised on reading")
ANGLES = Gain("rad", shape=(3,), spread=False, text="Tait-Bryan (3-2-1) angles yaw, pitch, roll")


MOMENTS = Gain("kg m^2", shape=(3, 3), plain=(1e9, "g cm^2"))


def _read_inertia(given: Any) -> Any:
    if not isinstance(given, list) or len(given) != 3:
        raise refuse("three principal moments or a 3x3 matrix, in kg m^2")
    shape = (3, 3) if any(isinstance(row, list) for row in given) else (3,)
    try:
        return check_inertia(reader(replace(MOMENTS, shape=shape))(given))
    except ValueError as error:
        raise refuse(str(error)) from None


INERTIA = (
    BeforeValidator(_read_inertia),
    Field(description="three principal moments or a 3x3 matrix, including the wheels (kg m^2)"),
    MOMENTS,
)


class Spacecraft(Table):
    """The body and its actuators."""

    inertia: Annotated[Any, *INERTIA]
    mass: Annotated[float | None, *quantity(Gain("kg", above=0.0, text="mass, for forces that change the orbit"))] = None
    torque_limit: Annotated[float, *quantity(Gain("N m", above=0.0, plain=(1e3, "mN m"), text="largest torque"))] = math.inf
    limit: Annotated[
        Literal["axis", "norm", "none"], Field(description="whether the limit holds for each axis, the norm, or not at all")
    ] = "axis"
    actuator_lag: Annotated[float, *quantity(Gain("s", at_least=0.0, text="time constant of the actuators"))] = 0.0
    torque_rate_limit: Annotated[float, *quantity(Gain("N m/s", above=0.0, text="fastest change of each torque"))] = math.inf


class Pointing(Table):
    """An attitude, given as a quaternion or as angles."""

    attitude: Annotated[Any, *quantity(QUATERNION)] = None
    angles: Annotated[Any, *quantity(ANGLES)] = None

    @model_validator(mode="after")
    def _one_attitude(self) -> Self:
        if self.attitude is not None and self.angles is not None:
            raise at_key("angles", "either attitude or angles, not both", list(self.angles))
        try:
            if self.attitude is not None:
                check_attitude(self.attitude)
        except ValueError as error:
            raise at_key("attitude", str(error), list(self.attitude or ())) from None
        return self


class Initial(Pointing):
    """Attitude and rate at the start, in the inertial frame or relative to the target."""

    rate: Annotated[Any, *quantity(Gain("rad/s", shape=(3,), spread=False, text="angular velocity, body axes"))] = (
        0.0,
        0.0,
        0.0,
    )
    relative_to: Annotated[
        Literal["inertial", "target"], Field(description="frame to which attitude and rate are relative")
    ] = "inertial"


class TargetTable(Pointing):
    """The attitude to point at."""

    mode: Annotated[
        Literal["inertial", "orbital", "history"],
        Field(description="fixed attitude, third axis to the centre of attraction, or the history in a file"),
    ] = "inertial"
    file: Annotated[
        str | None, Field(description="history beside the scenario: CSV of time (s), q0, q1, q2, q3, or a CCSDS AEM (.aem)")
    ] = None

    @model_validator(mode="after")
    def _fits_mode(self) -> Self:
        if (self.mode == "history") != (self.file is not None):
            raise at_key("file", 'a file exactly when mode = "history"', self.file)
        if self.mode != "inertial" and (self.attitude is not None or self.angles is not None):
            raise at_key("mode", '"inertial" where attitude or angles are given', self.mode)
        return self


class Environment(Table):
    """External torques."""

    gravity_gradient: Annotated[Flag, Field(description="gravity-gradient torque; laws know it")] = False
    torque_noise: Annotated[
        float, *quantity(Gain("N m", at_least=0.0, plain=(10.0, "mN m"), text="standard deviation per axis and step"))
    ] = 0.0


class Sensor(Table):
    """Errors of the measured state."""

    attitude_noise: Annotated[
        float, *quantity(Gain("rad", at_least=0.0, at_most=math.pi, text="standard deviation, angle per axis"))
    ] = 0.0
    rate_noise: Annotated[float, *quantity(Gain("rad/s", at_least=0.0, text="standard deviation per axis"))] = 0.0


class Simulation(SeededTiming):
    """The duration of a run and its time steps."""

    unit: ClassVar[str] = " s"
    duration: Annotated[float, *quantity(Gain("s", above=0.0, text="length of the run"))]
    control_period: Annotated[float, *quantity(Gain("s", above=0.0, text="time for which a torque is held"))] = 0.1


class Tolerances(Table):
    """The tolerances within which the target counts as reached."""

    attitude_tolerance: Annotated[float, *quantity(Gain("rad", above=0.0, text="angle to the target"))] = 2e-3
    rate_tolerance: Annotated[float, *quantity(Gain("rad/s", above=0.0, text="rate relative to the target"))] = 1e-3


TURNED = "small rotation of its axis about the body axes, unknown to law and allocation"


VISCOUS = quantity(Gain("N m s", at_least=0.0, plain=(0.1, "uN m s"), text="viscous friction per rad/s"))
COULOMB = quantity(Gain("N m", at_least=0.0, plain=(0.5, "mN m"), text="Coulomb friction, at any speed"))


class Rotor(Table):
    """A reaction wheel, given as a unit of the catalogue or by its parameters, which override those of the unit."""

    unit: Annotated[str | None, Field(description="a unit of the catalogue, see `starhold wheels`")] = None
    inertia: Annotated[
        float | None, *quantity(Gain("kg m^2", above=0.0, plain=(10.0, "g cm^2"), text="of the rotor about its axis"))
    ] = None
    torque_limit: Annotated[
        float | None, *quantity(Gain("N m", above=0.0, plain=(2.0, "mN m"), text="largest motor torque"))
    ] = None
    momentum_limit: Annotated[
        float | None, *quantity(Gain("N m s", above=0.0, plain=(1000.0, "mN m s"), text="largest angular momentum"))
    ] = None
    viscous: Annotated[float | None, *VISCOUS] = None
    coulomb: Annotated[float | None, *COULOMB] = None
    momentum: Annotated[float, *quantity(Gain("N m s", text="angular momentum at the start"))] = 0.0
    top_speed: Annotated[
        float | None,
        *quantity(Gain("rad/s", above=0.0, plain=(2e3, "rpm"), text='in place of momentum_limit, such as "6000 rpm"')),
    ] = None
    speed: Annotated[
        float | None, *quantity(Gain("rad/s", plain=(2e3, "rpm"), text="in place of momentum, for a body at rest"))
    ] = None
    static_friction: Annotated[
        float | None, *quantity(Gain("N m", at_least=0.0, plain=(0.5, "mN m"), text="largest friction, at low speed"))
    ] = None
    stribeck_speed: Annotated[
        float | None,
        *quantity(Gain("rad/s", above=0.0, plain=(2e3, "rpm"), text="speed at which friction has its largest value")),
    ] = None
    power_limit: Annotated[
        float | None, *quantity(Gain("W", above=0.0, text="largest power that drives the rotor: torque times speed"))
    ] = None
    static_imbalance: Annotated[
        float | None, *quantity(Gain("kg m", at_least=0.0, text="mass of the rotor times its distance from the axis"))
    ] = None
    dynamic_imbalance: Annotated[
        float | None,
        *quantity(
            Gain("kg m^2", at_least=0.0, plain=(1e-2, "g mm^2"), text="product of inertia of the rotor about its axis")
        ),
    ] = None
    position: Annotated[
        Any,
        *quantity(
            Gain("m", shape=(3,), spread=False, plain=(100.0, "mm"), text="position from the centre of mass, for imbalance")
        ),
    ] = None
    mounting_error: Annotated[Any, *quantity(replace(MOUNTING, text=TURNED))] = None

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        for speed, momentum in (("top_speed", "momentum_limit"), ("speed", "momentum")):
            if getattr(self, speed) is not None and momentum in self.model_fields_set:
                raise at_key(speed, f"either {speed} or {momentum}, not both", getattr(self, speed))
        return self


class WheelTable(Rotor):
    """One reaction wheel."""

    axis: Annotated[Any, *quantity(Gain("1", shape=(3,), spread=False, text="spin axis in body axes"))]


class WheelsTable(Rotor):
    """The parameters that all reaction wheels share, and their layout unless [[wheel]] tables give the axes."""

    layout: Annotated[
        Literal["orthogonal", "pyramid", "nasa-standard"] | None, Field(description="three or four wheels of one kind")
    ] = None
    allocation: Annotated[
        Literal["least-squares", "least-peak"], Field(description="how a torque is allocated among more than three wheels")
    ] = "least-squares"


Action: TypeAlias = Literal["none", "reallocate", "retune", "both"]


class FaultTable(Table):
    """A fault of a wheel, of the body or of both during the run, and the reaction to it."""

    time: Annotated[float, *quantity(Gain("s", at_least=0.0, text="time of the fault"))]
    wheel: Annotated[int | None, *quantity(Gain("1", at_least=1, whole=True, text="number of the wheel, from 1"))] = None
    lost: Annotated[Flag, Field(description="the motor gives no more torque")] = False
    torque_limit: Annotated[float | None, *quantity(Gain("N m", at_least=0.0, text="largest torque from then on"))] = None
    momentum_limit: Annotated[float | None, *quantity(Gain("N m s", above=0.0, text="largest momentum from then on"))] = None
    viscous: Annotated[float | None, *VISCOUS] = None
    coulomb: Annotated[float | None, *COULOMB] = None
    inertia: Annotated[Any, *INERTIA] = None
    delay: Annotated[float, *quantity(Gain("s", at_least=0.0, text="time until the fault is diagnosed and acted on"))] = 0.0
    action: Annotated[
        Action, Field(description="torque reallocated to the other wheels, gains redesigned for the torque left, or both")
    ] = "both"
    """Unless the action is "none", the law knows the new inertia from the diagnosis on."""

    @property
    def strikes_wheel(self) -> bool:
        """Whether the fault changes a wheel."""
        changed = (self.torque_limit, self.momentum_limit, self.viscous, self.coulomb)
        return self.lost or any(value is not None for value in changed)

    @model_validator(mode="after")
    def _does_something(self) -> Self:
        if not self.strikes_wheel and (self.wheel is not None or self.inertia is None):
            body = "" if self.inertia is not None else ", or a new inertia of the body without a wheel"
            raise at_key("lost", f"true, or a new torque_limit, momentum_limit, viscous or coulomb{body}", False)
        if self.strikes_wheel and self.wheel is None:
            raise at_key("wheel", "the number of a wheel, from 1", None)
        return self


class CertifyTable(Table):
    """The claims of certificates; by default, the most that can be proved."""

    rate: Annotated[
        float | None,
        *quantity_or("any", math.inf, Gain("rad/s", above=0.0, text="convergence from every attitude at up to this rate")),
    ] = None
    slew_angle: Annotated[
        float | None, *quantity(Gain("rad", above=0.0, at_most=math.pi, text="slews from rest within the torque limit"))
    ] = None
    inertia_tolerance: Annotated[
        float | None, *quantity(Gain("1", above=0.0, at_most=1.0, text="bound on errors of J_ij / sqrt(J_ii J_jj)"))
    ] = None
    disturbance: Annotated[float, *quantity(Gain("N m", at_least=0.0, text="largest norm of unmodelled torque"))] = 0.0
    momentum: Annotated[
        float | None,
        *quantity(
            Gain("N m s", at_least=0.0, text="total angular momentum for claims about wheels; that at the start if absent")
        ),
    ] = None


class AttitudeLawTable(LawTable):
    """The keys of every law table besides the law's own gains."""

    quaternion_sign: Annotated[
        Literal["as_published", "shortest", "hysteresis"], Field(description="choice between q and -q for the law")
    ] = "as_published"
    hysteresis_width: Annotated[float, *quantity(Gain("1", above=0.0, at_most=0.999, text="flips when h q0 < -width"))] = 0.5
    fault_action: Annotated[Action | None, Field(description="reaction to faults, in place of each fault's action")] = None


class RigidBodyTable(ScenarioTable):
    """A scenario file without its law tables, which are read one by one."""

    spacecraft: Spacecraft
    orbit: Orbit | None = None
    initial: Initial = Initial()
    target: TargetTable = TargetTable()
    environment: Environment = Environment()
    sensor: Sensor = Sensor()
    simulation: Simulation
    settling: Tolerances = Tolerances()
    certify: CertifyTable = CertifyTable()
    transient: TransientTable | None = None
    budget: BudgetTable = BudgetTable()
    wheels: WheelsTable | None = None
    wheel: list[WheelTable] = Field(default_factory=list[WheelTable])
    fault: list[FaultTable] = Field(default_factory=list[FaultTable])
    SHARED = MappingProxyType({"orbit.epoch": START, "orbit.ephemeris": 0, "spacecraft.mass": math.inf})

    @model_validator(mode="after")
    def _wheels_have_axes(self) -> Self:
        layout = None if self.wheels is None else self.wheels.layout
        if (layout is None) == (not self.wheel) and (self.wheels is not None or self.wheel):
            raise at_key("wheels.layout", "either a layout or [[wheel]] tables", layout)
        return self

    @model_validator(mode="after")
    def _has_orbit(self) -> Self:
        if self.orbit is None and self.environment.gravity_gradient:
            raise at_key("environment.gravity_gradient", "false without an [orbit] table", True)
        if self.orbit is None and self.target.mode == "orbital":
            raise at_key("target.mode", '"orbital" only with an [orbit] table', "orbital")
        if self.orbit is not None:
            self.orbit.check_flight(self.simulation.duration)
        return self

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        body = self.spacecraft
        if body.mass is not None and body.mass > (most := heaviest(body.inertia)):
            allowed = f"at most {most:.3g} kg: with this inertia more would be denser than any metal; is another unit meant?"
            raise at_key("spacecraft.mass", allowed, body.mass)
        return self
