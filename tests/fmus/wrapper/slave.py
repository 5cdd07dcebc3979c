"""A slave without physics for the wrapper alone: it keeps what it is given, writes down its calls, fails on request.

Of the standard library only, for a bare Python under Wine. What a value reference asks for is in ASKED_FOR.
"""

import math
import struct
from pathlib import Path

OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3

#: Types of both versions; a Boolean has the size that its version gives it.
FORMATS = {
    "Real": "d",
    "Integer": "i",
    "Float64": "d",
    "Float32": "f",
    "Int8": "b",
    "UInt8": "B",
    "Int16": "h",
    "UInt16": "H",
    "Int32": "i",
    "UInt32": "I",
    "Int64": "q",
    "UInt64": "Q",
}

ASKED_FOR = {
    95: (WARNING, None, [(WARNING, "logStatusWarning", "95 is odd")]),
    96: (DISCARD, None, [(DISCARD, "logStatusError", "not now")]),
    97: "nonsense",
    99: (ERROR, None, [(ERROR, "invalidInput", "100% of #99 is wrong")]),
    100: (OK, None, [("x", "y")]),
    101: (7, None, []),
}
RAISES = 98
#: What is alive: slaves and states.
LIVE = 90

FINE = (OK, None, [])

alive = [0]


class Counted:
    """Something that the wrapper has to let go of."""

    def __init__(self):
        alive[0] += 1

    def __del__(self):
        alive[0] -= 1


class State(Counted):
    """A copy of a slave's values."""

    def __init__(self, values, texts, time):
        super().__init__()
        self.values, self.texts, self.time = dict(values), dict(texts), time


def integers(view):
    return [number for (number,) in struct.iter_unpack("I", view)]


def doubles(view):
    return [number for (number,) in struct.iter_unpack("d", view)]


class Slave(Counted):
    """Answers as the contract of instance.h says."""

    def __init__(self, resources, token, fmi):
        super().__init__()
        self.fmi, self.record = fmi, None if token == "silent" else Path(resources, "calls.txt")
        self.values, self.texts, self.time = {}, {}, 0.0
        self.write("instantiate", Path(resources).name, token, fmi)

    def write(self, *words):
        if self.record is not None:
            with self.record.open("a", encoding="utf-8") as file:
                file.write(" ".join(map(str, words)) + "\n")

    def answer(self, references):
        first = references[0] if references else 0
        if first == RAISES:
            raise ValueError("the slave has a defect")
        return ASKED_FOR.get(first, FINE)

    def format(self, name, count):
        return f"{count}{FORMATS[name] if name != 'Boolean' else 'i' if self.fmi == 2 else '?'}"

    # --- life ---------------------------------------------------------------------------------------------------------

    def setup_experiment(self, start, stop):
        self.write("setup_experiment", start, stop)
        self.time = start
        return FINE

    def enter_initialization_mode(self, *times):
        self.write("enter_initialization_mode", *times)
        self.time = times[0] if times else self.time
        return FINE

    def exit_initialization_mode(self):
        self.write("exit_initialization_mode")
        return FINE

    def terminate(self):
        self.write("terminate")
        return FINE

    def reset(self):
        self.write("reset")
        self.time = 0.0
        return FINE

    def prepare_step(self, time, step):
        self.write("prepare_step", time, step)
        return FINE if step > 0 else (ERROR, None, [(ERROR, "invalidInput", "no step backwards")])

    def set_at_end(self, references, values):
        self.write("set_at_end", integers(references), doubles(values))
        return self.answer(integers(references))

    def do_step(self, time, step):
        self.write("do_step", time, step)
        if math.isnan(step):
            raise ArithmeticError("what a step")
        if step > 1:
            return DISCARD, None, [(DISCARD, "logStatusError", "a step too far")]
        self.time = time + step
        return FINE

    def reached(self):
        return OK, "never" if self.time < 0 else self.time, []

    # --- values -------------------------------------------------------------------------------------------------------

    def get_numbers(self, name, references, values):
        wanted = integers(references)
        self.write("get_numbers", name, wanted, values.nbytes)
        count = values.nbytes // struct.calcsize(self.format(name, 1))
        found = [alive[0] if wanted == [LIVE] else self.values.get(wanted[0] + place, 0) for place in range(count)]
        struct.pack_into(self.format(name, count), values, 0, *found)
        return self.answer(wanted)

    def set_numbers(self, name, references, values):
        wanted = integers(references)
        count = values.nbytes // struct.calcsize(self.format(name, 1))
        found = struct.unpack(self.format(name, count), values)
        self.write("set_numbers", name, wanted, list(found))
        self.values |= {wanted[0] + place: value for place, value in enumerate(found)}
        return self.answer(wanted)

    def get_strings(self, references):
        wanted = integers(references)
        self.write("get_strings", wanted)
        if wanted == [94]:
            return OK, [b"too", b"many"], []
        if wanted == [93]:
            return OK, ["no bytes"], []
        answer = self.answer(wanted)
        return (*answer[:1], [self.texts.get(reference, "").encode() for reference in wanted], *answer[2:])

    def set_strings(self, references, texts):
        wanted = integers(references)
        self.write("set_strings", wanted, texts)
        self.texts |= dict(zip(wanted, texts, strict=False))
        return self.answer(wanted)

    def refuse_type(self, name, references):
        self.write("refuse_type", name, integers(references))
        return ERROR, None, [(ERROR, "invalidInput", f"'x' is of type Real, not {name}")]

    def set_input_derivatives(self, references, orders, values):
        self.write("set_input_derivatives", integers(references), integers(orders), doubles(values))
        return self.answer(integers(references))

    def get_directional_derivative(self, unknowns, knowns, seed, sensitivity):
        self.write("get_directional_derivative", integers(unknowns), integers(knowns), doubles(seed))
        struct.pack_into("d", sensitivity, 0, 2 * doubles(seed)[0])
        return FINE

    def get_adjoint_derivative(self, unknowns, knowns, seed, sensitivity):
        self.write("get_adjoint_derivative", integers(unknowns), integers(knowns), doubles(seed))
        struct.pack_into("d", sensitivity, 0, 3 * doubles(seed)[0])
        return FINE

    # --- states -------------------------------------------------------------------------------------------------------

    def get_state(self):
        self.write("get_state")
        return OK, State(self.values, self.texts, self.time), []

    def set_state(self, state):
        self.write("set_state", state.time)
        self.values, self.texts, self.time = dict(state.values), dict(state.texts), state.time
        return FINE

    def state_to_bytes(self, state):
        self.write("state_to_bytes")
        return OK, repr((state.values, state.texts, state.time)).encode(), []

    def state_from_bytes(self, data):
        self.write("state_from_bytes", len(data))
        try:
            return OK, State(*eval(data)), []
        except SyntaxError:
            return ERROR, None, [(ERROR, "invalidInput", "these bytes are no state")]
