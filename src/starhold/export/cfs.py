"""A law as an app of the core Flight System (cFS), over the same C: an app folder as its build expects one."""

from __future__ import annotations

from starhold.export.code import Code


def files(code: Code) -> dict[str, str]:
    """Return the app's own files, by their places; its build takes the C from the folder above."""
    upper = code.name.upper()

    def filled(text: str) -> str:
        return (
            text.replace("@NAME@", code.name).replace("@UPPER@", upper).replace("@PERIOD@", f"{code.flight.loop.period:g}")
        )

    app = f"{code.name}_app"
    return {
        f"{app}/CMakeLists.txt": filled(_CMAKE),
        f"{app}/fsw/inc/{app}_msgids.h": filled(_IDS),
        f"{app}/fsw/inc/{app}_msg.h": filled(_MESSAGES),
        f"{app}/fsw/src/{app}.c": filled(_APP),
    }


_CMAKE = """\
project(CFS_@UPPER@_APP C)

# The law stands in the folder above. Its bits are those of the simulation only without contraction.
set_source_files_properties(${CMAKE_CURRENT_SOURCE_DIR}/../@NAME@.c PROPERTIES COMPILE_OPTIONS -ffp-contract=off)
add_cfe_app(@NAME@_app fsw/src/@NAME@_app.c ../@NAME@.c)
target_include_directories(@NAME@_app PUBLIC fsw/inc ..)
"""
_IDS = """\
/* Message identifiers of @NAME@_app. Choose values that are free in your mission. */

#ifndef @UPPER@_APP_MSGIDS_H
#define @UPPER@_APP_MSGIDS_H

/* From the scheduler, every @PERIOD@ s. */
#define @UPPER@_APP_WAKEUP_MID 0x18E0
/* What was measured, from the navigation app. */
#define @UPPER@_APP_INPUT_MID 0x08E0
/* What is commanded, to the actuators. */
#define @UPPER@_APP_COMMAND_MID 0x08E1

#endif
"""
_MESSAGES = """\
/* Messages of @NAME@_app: the structs of the law behind the header of telemetry. */

#ifndef @UPPER@_APP_MSG_H
#define @UPPER@_APP_MSG_H

#include "cfe_msg_hdr.h"

#include "@NAME@.h"

typedef struct {
    CFE_MSG_TelemetryHeader_t header;
    @NAME@_input_t payload;
} @UPPER@_APP_InputMsg_t;

typedef struct {
    CFE_MSG_TelemetryHeader_t header;
    @NAME@_command_t payload;
} @UPPER@_APP_CommandMsg_t;

#endif
"""
_APP = """\
/* @NAME@_app: at each wakeup one step of the law, from the last measurement, and a message with the command.

   Before the first measurement nothing is commanded. The law is stepped once in each wakeup, which must come every
   @PERIOD@ s: a measurement that is late is used again, and counted. */

#include "cfe.h"

#include "@NAME@_app_msg.h"
#include "@NAME@_app_msgids.h"

#define PIPE_DEPTH 8
#define EVENT_STARTED 1
#define EVENT_PIPE 2
#define EVENT_LENGTH 3
#define EVENT_UNKNOWN 4

typedef struct {
    uint32 run_status;
    CFE_SB_PipeId_t pipe;
    @NAME@_state_t state;
    @NAME@_input_t input;
    bool is_measured;
    bool is_fresh;
    uint32 stale_steps;
    @UPPER@_APP_CommandMsg_t command;
} app_data_t;

static app_data_t app;

void @UPPER@_APP_Main(void);

static CFE_Status_t start(void)
{
    CFE_Status_t status = CFE_EVS_Register(NULL, 0, CFE_EVS_EventFilter_BINARY);

    @NAME@_init(&app.state);
    app.is_measured = false;
    app.is_fresh = false;
    app.stale_steps = 0;
    if (status == CFE_SUCCESS) {
        status = CFE_MSG_Init(CFE_MSG_PTR(app.command.header), CFE_SB_ValueToMsgId(@UPPER@_APP_COMMAND_MID),
                              sizeof(app.command));
    }
    if (status == CFE_SUCCESS) {
        status = CFE_SB_CreatePipe(&app.pipe, PIPE_DEPTH, "@UPPER@_PIPE");
    }
    if (status == CFE_SUCCESS) {
        status = CFE_SB_Subscribe(CFE_SB_ValueToMsgId(@UPPER@_APP_WAKEUP_MID), app.pipe);
    }
    if (status == CFE_SUCCESS) {
        status = CFE_SB_Subscribe(CFE_SB_ValueToMsgId(@UPPER@_APP_INPUT_MID), app.pipe);
    }
    if (status == CFE_SUCCESS) {
        CFE_EVS_SendEvent(EVENT_STARTED, CFE_EVS_EventType_INFORMATION, "@UPPER@_APP: started");
    }
    return status;
}

static void step(void)
{
    if (!app.is_measured) {
        return;
    }
    if (!app.is_fresh) {
        app.stale_steps++;
    }
    app.is_fresh = false;
    @NAME@_step(&app.state, &app.input, &app.command.payload);
    CFE_SB_TimeStampMsg(CFE_MSG_PTR(app.command.header));
    (void)CFE_SB_TransmitMsg(CFE_MSG_PTR(app.command.header), true);
}

static void measure(const CFE_SB_Buffer_t *buffer)
{
    CFE_MSG_Size_t size = 0;

    (void)CFE_MSG_GetSize(&buffer->Msg, &size);
    if (size != sizeof(@UPPER@_APP_InputMsg_t)) {
        CFE_EVS_SendEvent(EVENT_LENGTH, CFE_EVS_EventType_ERROR, "@UPPER@_APP: a measurement of %u bytes",
                          (unsigned int)size);
        return;
    }
    app.input = ((const @UPPER@_APP_InputMsg_t *)(const void *)buffer)->payload;
    app.is_measured = true;
    app.is_fresh = true;
}

static void receive(const CFE_SB_Buffer_t *buffer)
{
    CFE_SB_MsgId_t id = CFE_SB_INVALID_MSG_ID;

    (void)CFE_MSG_GetMsgId(&buffer->Msg, &id);
    switch (CFE_SB_MsgIdToValue(id)) {
    case @UPPER@_APP_WAKEUP_MID:
        step();
        break;
    case @UPPER@_APP_INPUT_MID:
        measure(buffer);
        break;
    default:
        CFE_EVS_SendEvent(EVENT_UNKNOWN, CFE_EVS_EventType_ERROR, "@UPPER@_APP: unknown message 0x%x",
                          (unsigned int)CFE_SB_MsgIdToValue(id));
        break;
    }
}

void @UPPER@_APP_Main(void)
{
    CFE_SB_Buffer_t *buffer = NULL;

    app.run_status = start() == CFE_SUCCESS ? CFE_ES_RunStatus_APP_RUN : CFE_ES_RunStatus_APP_ERROR;
    while (CFE_ES_RunLoop(&app.run_status)) {
        if (CFE_SB_ReceiveBuffer(&buffer, app.pipe, CFE_SB_PEND_FOREVER) == CFE_SUCCESS) {
            receive(buffer);
        } else {
            CFE_EVS_SendEvent(EVENT_PIPE, CFE_EVS_EventType_ERROR, "@UPPER@_APP: its pipe cannot be read");
            app.run_status = CFE_ES_RunStatus_APP_ERROR;
        }
    }
    CFE_ES_ExitApp(app.run_status);
}
"""
