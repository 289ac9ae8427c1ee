"""A law as a component of F´, over the same C: its model in FPP, and what implements its handlers."""

from __future__ import annotations

from starhold.export.code import Code
from starhold.export.fmu import variables


def files(code: Code) -> dict[str, str]:
    """Return the component's own files, by their places; its build takes the C from the folders above."""
    given, told = variables(code)
    name = "".join(word.capitalize() for word in code.name.split("_"))
    parts = {
        "@FILE@": code.name,
        "@NAME@": name,
        "@TITLE@": code.flight.loop.law.card.title,
        "@PERIOD@": f"{code.flight.loop.period:g}",
        "@INPUTS@": str(len(given)),
        "@OUTPUTS@": str(len(told)),
        "@GIVEN@": ", ".join(given),
        "@TOLD@": ", ".join(told),
    }

    def filled(text: str) -> str:
        for key, value in parts.items():
            text = text.replace(key, value)
        return text

    made = {"CMakeLists.txt": _CMAKE, f"{name}.fpp": _MODEL, f"{name}.hpp": _HEADER, f"{name}.cpp": _SOURCE}
    return {f"Components/{name}/{file}": filled(text) for file, text in made.items()}


_CMAKE = """\
set(SOURCE_FILES
    "${CMAKE_CURRENT_LIST_DIR}/@NAME@.fpp"
    "${CMAKE_CURRENT_LIST_DIR}/@NAME@.cpp"
    "${CMAKE_CURRENT_LIST_DIR}/../../@FILE@.c"
)
# The bits of the law are those of the simulation only without contraction.
set_source_files_properties("${CMAKE_CURRENT_LIST_DIR}/../../@FILE@.c" PROPERTIES COMPILE_OPTIONS -ffp-contract=off)
include_directories("${CMAKE_CURRENT_LIST_DIR}/../..")
register_fprime_module()
"""
_MODEL = """\
module Flight {

  @ What @FILE@ takes, in this order: @GIVEN@
  array @NAME@Input = [@INPUTS@] F64

  @ What it gives: @TOLD@
  array @NAME@Command = [@OUTPUTS@] F64

  port @NAME@Measured($input: @NAME@Input)

  port @NAME@Commanded(command: @NAME@Command)

  @ @TITLE@
  passive component @NAME@ {

    @ From a rate group, every @PERIOD@ s: one step of the law
    guarded input port run: Svc.Sched

    @ What was measured; the last is used
    guarded input port measured: @NAME@Measured

    @ What is commanded until the next step
    output port commanded: @NAME@Commanded

  }

}
"""
_HEADER = """\
// @NAME@: at each call of `run` one step of the law, from the last measurement.
// Before the first measurement nothing is commanded.

#ifndef Flight_@NAME@_HPP
#define Flight_@NAME@_HPP

#include "Components/@NAME@/@NAME@ComponentAc.hpp"

#include "@FILE@.h"

namespace Flight {

class @NAME@ : public @NAME@ComponentBase {
  public:
    explicit @NAME@(const char* const name);
    ~@NAME@() override = default;

  private:
    void run_handler(FwIndexType port, U32 context) override;
    void measured_handler(FwIndexType port, const @NAME@Input& input) override;

    @FILE@_state_t m_state;
    @FILE@_input_t m_input;
    bool m_isMeasured;
};

}  // namespace Flight

#endif
"""
_SOURCE = """\
#include "Components/@NAME@/@NAME@.hpp"

#include <cstring>

namespace Flight {

// The structs of the law hold doubles alone.
static_assert(sizeof(@FILE@_input_t) == @INPUTS@ * sizeof(double), "the input is not what the model says");
static_assert(sizeof(@FILE@_command_t) == @OUTPUTS@ * sizeof(double), "the command is not what the model says");

@NAME@::@NAME@(const char* const name) : @NAME@ComponentBase(name), m_state(), m_input(), m_isMeasured(false) {
    @FILE@_init(&this->m_state);
}

void @NAME@::run_handler(FwIndexType port, U32 context) {
    (void)port;
    (void)context;
    if (!this->m_isMeasured) {
        return;
    }
    @FILE@_command_t given;
    @FILE@_step(&this->m_state, &this->m_input, &given);
    double numbers[@OUTPUTS@];
    (void)std::memcpy(numbers, &given, sizeof numbers);
    @NAME@Command command;
    for (U32 k = 0; k < @OUTPUTS@; k++) {
        command[k] = numbers[k];
    }
    if (this->isConnected_commanded_OutputPort(0)) {
        this->commanded_out(0, command);
    }
}

void @NAME@::measured_handler(FwIndexType port, const @NAME@Input& input) {
    (void)port;
    double numbers[@INPUTS@];
    for (U32 k = 0; k < @INPUTS@; k++) {
        numbers[k] = input[k];
    }
    (void)std::memcpy(&this->m_input, numbers, sizeof numbers);
    this->m_isMeasured = true;
}

}  // namespace Flight
"""
