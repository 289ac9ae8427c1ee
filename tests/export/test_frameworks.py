"""Apps of cFS and components of F´ over the same C: compiled against stubs of the headers, and stepped by them."""

import json
import re
import subprocess

import pytest

from tests.export.flown import STRICT, build_in, code_of, need, put
from tests.running import starhold

CFE = """
#ifndef CFE_H
#define CFE_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include "cfe_msg_hdr.h"
typedef int32_t int32; typedef uint32_t uint32; typedef uint16_t uint16;
typedef int32 CFE_Status_t; typedef uint32 CFE_SB_PipeId_t; typedef size_t CFE_MSG_Size_t;
typedef struct { uint32 value; } CFE_SB_MsgId_t;
typedef uint32 CFE_SB_MsgId_Atom_t;
typedef union { CFE_MSG_Message_t Msg; double align; } CFE_SB_Buffer_t;
typedef struct { uint16 id, mask; } CFE_EVS_BinFilter_t;
enum { CFE_SUCCESS = 0, CFE_SB_PEND_FOREVER = -1, CFE_EVS_EventFilter_BINARY = 0, CFE_EVS_EventType_INFORMATION = 2,
       CFE_EVS_EventType_ERROR = 3, CFE_ES_RunStatus_APP_RUN = 1, CFE_ES_RunStatus_APP_ERROR = 3 };
#define CFE_SB_INVALID_MSG_ID ((CFE_SB_MsgId_t){0})
CFE_Status_t CFE_EVS_Register(const void *filters, uint16 count, uint16 scheme);
CFE_Status_t CFE_EVS_SendEvent(uint16 id, uint16 type, const char *text, ...);
CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t *message, CFE_SB_MsgId_t id, CFE_MSG_Size_t size);
CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t *message, CFE_MSG_Size_t *size);
CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t *message, CFE_SB_MsgId_t *id);
CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t *pipe, uint16 depth, const char *name);
CFE_Status_t CFE_SB_Subscribe(CFE_SB_MsgId_t id, CFE_SB_PipeId_t pipe);
CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t **buffer, CFE_SB_PipeId_t pipe, int32 timeout);
CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t *message, bool origination);
void CFE_SB_TimeStampMsg(CFE_MSG_Message_t *message);
CFE_SB_MsgId_t CFE_SB_ValueToMsgId(CFE_SB_MsgId_Atom_t value);
CFE_SB_MsgId_Atom_t CFE_SB_MsgIdToValue(CFE_SB_MsgId_t id);
bool CFE_ES_RunLoop(uint32 *status);
void CFE_ES_ExitApp(uint32 status);
#endif
"""
HEADERS = """
#ifndef CFE_MSG_HDR_H
#define CFE_MSG_HDR_H
#include <stddef.h>
typedef struct { unsigned id; size_t size; } CFE_MSG_Message_t;
typedef struct { CFE_MSG_Message_t Msg; double stamp; } CFE_MSG_TelemetryHeader_t;
#define CFE_MSG_PTR(header) (&((header).Msg))
#endif
"""
BUS = """
#include "cfe.h"
#include "lyapunov_app_msg.h"
#include "lyapunov_app_msgids.h"
#include <stdio.h>
void LYAPUNOV_APP_Main(void);
static LYAPUNOV_APP_InputMsg_t measured, broken;
static CFE_MSG_Message_t wakeup = {LYAPUNOV_APP_WAKEUP_MID, sizeof(CFE_MSG_Message_t)}, other = {1, 1};
static int turn;
CFE_Status_t CFE_EVS_Register(const void *a, uint16 b, uint16 c) { (void)a; (void)b; (void)c; return 0; }
CFE_Status_t CFE_EVS_SendEvent(uint16 id, uint16 b, const char *c, ...)
{ (void)b; (void)c; printf("event %d\\n", id); return 0; }
CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t *m, CFE_SB_MsgId_t i, CFE_MSG_Size_t n)
{ m->id = i.value; m->size = n; return 0; }
CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t *m, CFE_MSG_Size_t *n) { *n = m->size; return 0; }
CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t *m, CFE_SB_MsgId_t *i) { i->value = m->id; return 0; }
CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t *p, uint16 d, const char *n) { (void)d; (void)n; *p = 1; return 0; }
CFE_Status_t CFE_SB_Subscribe(CFE_SB_MsgId_t i, CFE_SB_PipeId_t p)
{ (void)p; printf("subscribed %x\\n", i.value); return 0; }
CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t **b, CFE_SB_PipeId_t p, int32 t)
{
    void *sent[] = {&wakeup, &broken, &other, &measured, &wakeup};
    (void)p; (void)t;
    measured.header.Msg.id = broken.header.Msg.id = LYAPUNOV_APP_INPUT_MID;
    measured.header.Msg.size = sizeof measured;
    measured.payload = (lyapunov_input_t){{0.8, 0.0, 0.6, 0.0}, {0.01, -0.02, 0.03}, {7e6, 1.0, 2.0}};
    *b = sent[turn++];
    return 0;
}
CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t *m, bool o)
{
    const double *u = (const double *)(const void *)&((const LYAPUNOV_APP_CommandMsg_t *)(const void *)m)->payload;
    printf("sent %x %d %a %a %a\\n", m->id, o, u[0], u[1], u[2]);
    return 0;
}
void CFE_SB_TimeStampMsg(CFE_MSG_Message_t *m) { (void)m; }
CFE_SB_MsgId_t CFE_SB_ValueToMsgId(CFE_SB_MsgId_Atom_t v) { return (CFE_SB_MsgId_t){v}; }
CFE_SB_MsgId_Atom_t CFE_SB_MsgIdToValue(CFE_SB_MsgId_t i) { return i.value; }
bool CFE_ES_RunLoop(uint32 *status) { return *status == CFE_ES_RunStatus_APP_RUN && turn < 5; }
void CFE_ES_ExitApp(uint32 status) { printf("exit %u\\n", status); }
int main(void) { LYAPUNOV_APP_Main(); return 0; }
"""
BASE = """
#pragma once
#include <cstdint>
#include <cstdio>
typedef std::uint32_t U32; typedef int FwIndexType;
namespace Flight {
template <int N> struct Array { double e[N]; double& operator[](U32 k) { return e[k]; }
  const double& operator[](U32 k) const { return e[k]; } };
typedef Array<INPUTS> NAMEInput; typedef Array<3> NAMECommand;
class NAMEComponentBase {
 public:
  explicit NAMEComponentBase(const char* name) { (void)name; }
  virtual ~NAMEComponentBase() = default;
  void run(U32 context) { run_handler(0, context); }
  void measured(const NAMEInput& input) { measured_handler(0, input); }
 protected:
  virtual void run_handler(FwIndexType port, U32 context) = 0;
  virtual void measured_handler(FwIndexType port, const NAMEInput& input) = 0;
  bool isConnected_commanded_OutputPort(FwIndexType port) { return port == 0; }
  void commanded_out(FwIndexType, const NAMECommand& u) { std::printf("sent %a %a %a\\n", u[0], u[1], u[2]); }
};
}
"""
RATE_GROUP = """
#include "Components/Lyapunov/Lyapunov.hpp"
int main() {
    Flight::Lyapunov law("law");
    law.run(0);
    law.measured({{0.8, 0.0, 0.6, 0.0, 0.01, -0.02, 0.03, 7e6, 1.0, 2.0}});
    law.run(0);
}
"""
LAW = """
#include "lyapunov.h"
#include <stdio.h>
int main(void)
{
    lyapunov_state_t state;
    lyapunov_command_t u;
    const lyapunov_input_t input = {{0.8, 0.0, 0.6, 0.0}, {0.01, -0.02, 0.03}, {7e6, 1.0, 2.0}};
    lyapunov_init(&state);
    lyapunov_step(&state, &input, &u);
    printf("%a %a %a\\n", u.torque.x, u.torque.y, u.torque.z);
    return 0;
}
"""


def output(folder, program):
    return subprocess.run([folder / program], capture_output=True, text=True, check=True).stdout


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the law, both shells over it, and what the law alone commands from one measurement."""
    need("gcc", "g++")
    folder = tmp_path_factory.mktemp("law")
    put(folder, code_of("lyapunov"), "cfs", "fprime")
    (folder / "law_main.c").write_text(LAW)
    build_in(folder, "gcc", "-std=c99", "-ffp-contract=off", "law_main.c", "lyapunov.c", "-lm", "-o", "alone")
    return folder, output(folder, "alone").strip()


def stubs(folder):
    (folder / "stubs").mkdir(exist_ok=True)
    (folder / "stubs" / "cfe.h").write_text(CFE)
    (folder / "stubs" / "cfe_msg_hdr.h").write_text(HEADERS)


def test_the_app_steps_the_law_at_each_wakeup(place):
    folder, alone = place
    stubs(folder)
    (folder / "bus.c").write_text(BUS)
    paths = ["-I.", "-Istubs", "-Ilyapunov_app/fsw/inc"]
    app = "lyapunov_app/fsw/src/lyapunov_app.c"
    build_in(folder, "gcc", *STRICT, "-fsyntax-only", *paths, app)
    build_in(folder, "gcc", "-std=c99", "-ffp-contract=off", *paths, app, "bus.c", "lyapunov.c", "-lm", "-o", "app")
    # Nothing before the first measurement; one that is too short, and a message of nobody, are told and passed over.
    told = ["subscribed 18e0", "subscribed 8e0", "event 1", "event 3", "event 4", f"sent 8e1 1 {alone}", "exit 1"]
    assert output(folder, "app").splitlines() == told


def test_the_component_steps_the_law_at_each_call(place):
    folder, alone = place
    header = folder / "Components" / "Lyapunov" / "LyapunovComponentAc.hpp"
    header.write_text(BASE.replace("NAME", "Lyapunov").replace("INPUTS", "10"))
    (folder / "rate_group.cpp").write_text(RATE_GROUP)
    source = "Components/Lyapunov/Lyapunov.cpp"
    build_in(folder, "g++", "-std=c++14", *STRICT[1:], "-fsyntax-only", "-I.", source)
    build_in(folder, "gcc", "-std=c99", "-ffp-contract=off", "-c", "lyapunov.c")
    build_in(folder, "g++", "-std=c++14", "-I.", source, "rate_group.cpp", "lyapunov.o", "-lm", "-o", "component")
    assert output(folder, "component") == f"sent {alone}\n"


@pytest.mark.parametrize("name", ["wheel", "mpc"])
def test_shells_of_other_laws_compile(name, tmp_path):
    need("gcc", "g++")
    put(tmp_path, code_of(name), "cfs", "fprime")
    stubs(tmp_path)
    app = f"{name}_app/fsw"
    build_in(tmp_path, "gcc", *STRICT, "-fsyntax-only", "-I.", "-Istubs", f"-I{app}/inc", f"{app}/src/{name}_app.c")
    title = name.capitalize()
    model = (tmp_path / "Components" / title / f"{title}.fpp").read_text()
    count = re.search(r"Input = \[(\d+)\] F64", model).group(1)
    header = tmp_path / "Components" / title / f"{title}ComponentAc.hpp"
    header.write_text(BASE.replace("NAME", title).replace("INPUTS", count))
    build_in(tmp_path, "g++", "-std=c++14", *STRICT[1:], "-fsyntax-only", "-I.", f"Components/{title}/{title}.cpp")


@pytest.mark.slow
def test_the_command_writes_folders_and_clears_them(tmp_path):
    words = ("export", "c", "three-laws", "--law", "lyapunov", "-o", "out", "--no-certify")
    starhold(*words, "--shell", "cfs", "--shell", "fprime", cwd=tmp_path, code=0)
    folder = tmp_path / "out"
    listed = json.loads((folder / "export.json").read_text())["files"]
    assert "lyapunov_app/fsw/src/lyapunov_app.c" in listed
    assert "Components/Lyapunov/Lyapunov.fpp" in listed
    assert all((folder / name).is_file() for name in listed)
    (folder / "Components" / "own.txt").write_text("kept")
    (tmp_path / "victim").write_text("kept")
    manifest = json.loads((folder / "export.json").read_text())
    (folder / "export.json").write_text(json.dumps(manifest | {"files": [*listed, "../victim", str(tmp_path / "victim")]}))
    assert starhold(*words, "--force", cwd=tmp_path).returncode == 0
    assert not (folder / "lyapunov_app").exists()
    assert [path.name for path in (folder / "Components").iterdir()] == ["own.txt"]
    assert (tmp_path / "victim").exists()
