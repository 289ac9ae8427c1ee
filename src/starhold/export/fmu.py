"""A law as the sources of an FMU for co-simulation, FMI 3.0, over the same C.

The standard wants every function of its interface in a binary; those that a sampled law has no use for refuse.
"""

from __future__ import annotations

import io
import uuid
import zipfile
from xml.sax.saxutils import quoteattr

from starhold.export.code import Code
from starhold.export.source import texts
from starhold.export.types import paths
from starhold.version import __version__

_TYPES = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean", "String")
_REFS = "const fmi3ValueReference r[], size_t n"
_CLOCKS = f"fmi3Instance i, {_REFS}"
_STATES = "fmi3Instance i, fmi3Float64 v[], size_t m"
_SEEDS = (
    "fmi3Instance i, const fmi3ValueReference u[], size_t a, const fmi3ValueReference k[], size_t b, "
    "const fmi3Float64 s[], size_t c, fmi3Float64 v[], size_t m"
)
_BINARIES = "const size_t s[], const fmi3Binary v[], size_t m"
_REFUSED = {
    **{f"fmi3Get{kind}": f"{_CLOCKS}, fmi3{kind} v[], size_t m" for kind in _TYPES},
    **{f"fmi3Set{kind}": f"{_CLOCKS}, const fmi3{kind} v[], size_t m" for kind in _TYPES},
    "fmi3GetBinary": f"{_CLOCKS}, size_t s[], fmi3Binary v[], size_t m",
    "fmi3SetBinary": f"{_CLOCKS}, {_BINARIES}",
    "fmi3GetClock": f"{_CLOCKS}, fmi3Clock v[]",
    "fmi3SetClock": f"{_CLOCKS}, const fmi3Clock v[]",
    "fmi3GetNumberOfVariableDependencies": "fmi3Instance i, fmi3ValueReference r, size_t *n",
    "fmi3GetVariableDependencies": "fmi3Instance i, fmi3ValueReference r, size_t a[], fmi3ValueReference b[], size_t c[], "
    "fmi3DependencyKind d[], size_t n",
    "fmi3SerializedFMUStateSize": "fmi3Instance i, fmi3FMUState s, size_t *n",
    "fmi3SerializeFMUState": "fmi3Instance i, fmi3FMUState s, fmi3Byte b[], size_t n",
    "fmi3DeserializeFMUState": "fmi3Instance i, const fmi3Byte b[], size_t n, fmi3FMUState *s",
    "fmi3GetDirectionalDerivative": _SEEDS,
    "fmi3GetAdjointDerivative": _SEEDS,
    "fmi3EnterConfigurationMode": "fmi3Instance i",
    "fmi3ExitConfigurationMode": "fmi3Instance i",
    "fmi3GetIntervalDecimal": f"{_CLOCKS}, fmi3Float64 v[], fmi3IntervalQualifier q[]",
    "fmi3GetIntervalFraction": f"{_CLOCKS}, fmi3UInt64 a[], fmi3UInt64 b[], fmi3IntervalQualifier q[]",
    "fmi3GetShiftDecimal": f"{_CLOCKS}, fmi3Float64 v[]",
    "fmi3GetShiftFraction": f"{_CLOCKS}, fmi3UInt64 a[], fmi3UInt64 b[]",
    "fmi3SetIntervalDecimal": f"{_CLOCKS}, const fmi3Float64 v[]",
    "fmi3SetIntervalFraction": f"{_CLOCKS}, const fmi3UInt64 a[], const fmi3UInt64 b[]",
    "fmi3SetShiftDecimal": f"{_CLOCKS}, const fmi3Float64 v[]",
    "fmi3SetShiftFraction": f"{_CLOCKS}, const fmi3UInt64 a[], const fmi3UInt64 b[]",
    "fmi3EvaluateDiscreteStates": "fmi3Instance i",
    "fmi3UpdateDiscreteStates": "fmi3Instance i, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *c, fmi3Boolean *d, "
    "fmi3Boolean *e, fmi3Float64 *f",
    "fmi3EnterContinuousTimeMode": "fmi3Instance i",
    "fmi3CompletedIntegratorStep": "fmi3Instance i, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *c",
    "fmi3SetTime": "fmi3Instance i, fmi3Float64 t",
    "fmi3SetContinuousStates": "fmi3Instance i, const fmi3Float64 v[], size_t m",
    "fmi3GetContinuousStateDerivatives": _STATES,
    "fmi3GetEventIndicators": _STATES,
    "fmi3GetContinuousStates": _STATES,
    "fmi3GetNominalsOfContinuousStates": _STATES,
    "fmi3GetNumberOfEventIndicators": "fmi3Instance i, size_t *n",
    "fmi3GetNumberOfContinuousStates": "fmi3Instance i, size_t *n",
    "fmi3EnterStepMode": "fmi3Instance i",
    "fmi3EnterEventMode": "fmi3Instance i",
    "fmi3GetOutputDerivatives": f"{_CLOCKS}, const fmi3Int32 o[], fmi3Float64 v[], size_t m",
    "fmi3ActivateModelPartition": "fmi3Instance i, fmi3ValueReference r, fmi3Float64 t",
}
"""Functions of FMI 3.0 that refuse, and their parameters."""


def files(code: Code) -> dict[str, bytes]:
    """Return the FMU, which is an archive of sources."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in contents(code).items():
            # Always the same bytes.
            archive.writestr(zipfile.ZipInfo(name, (2000, 1, 1, 0, 0, 0)), text, zipfile.ZIP_DEFLATED)
    return {f"{code.name}.fmu": made.getvalue()}


def contents(code: Code) -> dict[str, str]:
    """Return what is in the archive: the description of the model, of the build, and the sources."""
    text = texts(code, "", code.flight.loop.law.name)
    shell = _SHELL.replace("@NAME@", code.name).replace("@PERIOD@", repr(code.flight.loop.period))
    shell = shell.replace("@REFUSED@", "\n".join(_refused())).replace("@INPUTS@", str(len(variables(code)[0])))
    return {
        "modelDescription.xml": _description(code),
        "sources/buildDescription.xml": _BUILD.replace("@NAME@", code.name),
        "sources/fmi.c": shell.replace("@TOKEN@", _token(code)),
        f"sources/{code.name}.c": text.source,
        f"sources/{code.name}.h": text.header,
    }


def _token(code: Code) -> str:
    """Return a token that changes with the code."""
    return str(uuid.uuid5(uuid.NAMESPACE_URL, repr((code.name, code.program, code.flight.parameters))))


def variables(code: Code) -> tuple[list[str], list[str]]:
    """Return the names of the inputs, and those of the command."""
    given = [p.text.replace("input->", "") for p in code.signature.params[2].leaves if code.needs.reads(p)]
    shape = code.signature.result
    assert shape is not None
    told = [p.text.removeprefix(".") for p in paths(shape.members[0].type, "")]
    return [name.replace(".e[", "[") for name in given], told


def _description(code: Code) -> str:
    given, told = variables(code)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(code.name)} instantiationToken="{_token(code)}"',
        f'  generationTool="starhold {__version__}" variableNamingConvention="structured">',
        f'  <CoSimulation modelIdentifier="{code.name}" canHandleVariableCommunicationStepSize="true"',
        f'    fixedInternalStepSize="{code.flight.loop.period!r}" needsExecutionTool="false"/>',
        f'  <DefaultExperiment startTime="0.0" stepSize="{code.flight.loop.period!r}"/>',
        "  <ModelVariables>",
        '    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>',
    ]
    for reference, name in enumerate(given, 1):
        lines.append(f'    <Float64 name={quoteattr(name)} valueReference="{reference}" causality="input" start="0.0"/>')
    for reference, name in enumerate(told, 1 + len(given)):
        lines.append(
            f'    <Float64 name={quoteattr(name)} valueReference="{reference}" causality="output" variability="discrete"/>'
        )
    lines += ["  </ModelVariables>", "  <ModelStructure>"]
    lines += [f'    <Output valueReference="{k}"/>' for k in range(1 + len(given), 1 + len(given) + len(told))]
    lines += [line.replace("<Output", "<InitialUnknown") for line in lines if line.startswith("    <Output")]
    return "\n".join([*lines, "  </ModelStructure>", "</fmiModelDescription>", ""])


def _refused() -> list[str]:
    found: list[str] = []
    for name, params in _REFUSED.items():
        words = [param.replace("[]", "").split()[-1].lstrip("*") for param in params.split(",")]
        unused = " ".join(f"(void){word};" for word in words)
        found += [f"FMI3_Export fmi3Status {name}({params})", "{", f"    {unused}", "    return fmi3Error;", "}"]
    return found


_BUILD = """\
<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="@NAME@">
    <SourceFileSet language="C99" compilerOptions="-ffp-contract=off">
      <SourceFile name="fmi.c"/>
      <SourceFile name="@NAME@.c"/>
    </SourceFileSet>
    <Library name="m"/>
  </BuildConfiguration>
</fmiBuildDescription>
"""
_SHELL = """\
/* @NAME@ as an FMU for co-simulation, FMI 3.0. A step of the law is made at every multiple of its period, from the inputs
   that are set by then: set them, call fmi3DoStep for the interval, and read the command that is held in it. */

#include "@NAME@.h"

#include "fmi3Functions.h"

#include <stdlib.h>
#include <string.h>

#define TOKEN "@TOKEN@"
#define INPUTS @INPUTS@U
#define OUTPUTS 3U
#define PERIOD @PERIOD@

typedef struct {
    @NAME@_state_t state;
    @NAME@_input_t input;
    @NAME@_command_t command;
    double time;
    double begun;
    unsigned long long steps;
} instance_t;

FMI3_Export const char *fmi3GetVersion(void)
{
    return "3.0";
}

FMI3_Export fmi3Status fmi3SetDebugLogging(fmi3Instance i, fmi3Boolean on, size_t n, const fmi3String names[])
{
    (void)i; (void)on; (void)n; (void)names;
    return fmi3OK;
}

FMI3_Export fmi3Instance fmi3InstantiateModelExchange(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d, fmi3Boolean e,
    fmi3InstanceEnvironment f, fmi3LogMessageCallback g)
{
    (void)a; (void)b; (void)c; (void)d; (void)e; (void)f; (void)g;
    return NULL;
}

FMI3_Export fmi3Instance fmi3InstantiateScheduledExecution(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d,
    fmi3Boolean e, fmi3InstanceEnvironment f, fmi3LogMessageCallback g, fmi3ClockUpdateCallback h,
    fmi3LockPreemptionCallback j, fmi3UnlockPreemptionCallback k)
{
    (void)a; (void)b; (void)c; (void)d; (void)e; (void)f; (void)g; (void)h; (void)j; (void)k;
    return NULL;
}

FMI3_Export fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference wanted[], size_t count,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    instance_t *own = NULL;
    (void)name; (void)path; (void)visible; (void)logging; (void)events; (void)early; (void)wanted; (void)count;
    (void)environment; (void)log; (void)update;
    if (strcmp(token, TOKEN) == 0) {
        own = calloc(1, sizeof *own);
    }
    if (own != NULL) {
        @NAME@_init(&own->state);
    }
    return own;
}

FMI3_Export void fmi3FreeInstance(fmi3Instance i)
{
    free(i);
}

FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean a, fmi3Float64 b, fmi3Float64 start,
    fmi3Boolean c, fmi3Float64 d)
{
    instance_t *const own = i;
    (void)a; (void)b; (void)c; (void)d;
    own->begun = own->time = start;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3ExitInitializationMode(fmi3Instance i)
{
    (void)i;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3Terminate(fmi3Instance i)
{
    (void)i;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3Reset(fmi3Instance i)
{
    instance_t *const own = i;
    memset(own, 0, sizeof *own);
    @NAME@_init(&own->state);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[],
    size_t m)
{
    instance_t *const own = i;
    double numbers[INPUTS];
    (void)m;
    memcpy(numbers, &own->input, sizeof numbers);
    for (size_t k = 0; k < n; k++) {
        if (r[k] < 1U || r[k] > INPUTS) {
            return fmi3Error;
        }
        numbers[r[k] - 1U] = v[k];
    }
    memcpy(&own->input, numbers, sizeof numbers);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t m)
{
    instance_t *const own = i;
    double numbers[1U + INPUTS + OUTPUTS];
    (void)m;
    numbers[0] = own->time;
    memcpy(&numbers[1], &own->input, INPUTS * sizeof(double));
    memcpy(&numbers[1U + INPUTS], &own->command, OUTPUTS * sizeof(double));
    for (size_t k = 0; k < n; k++) {
        if (r[k] > INPUTS + OUTPUTS) {
            return fmi3Error;
        }
        v[k] = numbers[r[k]];
    }
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance i, fmi3Float64 now, fmi3Float64 length, fmi3Boolean fixed, fmi3Boolean *event,
    fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last)
{
    instance_t *const own = i;
    (void)fixed;
    /* Instants lie at multiples of the period, give or take the rounding of the times that are told. */
    while (own->begun + (double)own->steps * PERIOD < now + length - 1e-6 * PERIOD) {
        @NAME@_step(&own->state, &own->input, &own->command);
        own->steps++;
    }
    own->time = now + length;
    *event = fmi3False;
    *end = fmi3False;
    *early = fmi3False;
    *last = own->time;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetFMUState(fmi3Instance i, fmi3FMUState *s)
{
    if (*s == NULL) {
        *s = malloc(sizeof(instance_t));
    }
    if (*s == NULL) {
        return fmi3Error;
    }
    memcpy(*s, i, sizeof(instance_t));
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SetFMUState(fmi3Instance i, fmi3FMUState s)
{
    memcpy(i, s, sizeof(instance_t));
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3FreeFMUState(fmi3Instance i, fmi3FMUState *s)
{
    (void)i;
    free(*s);
    *s = NULL;
    return fmi3OK;
}

@REFUSED@
"""
