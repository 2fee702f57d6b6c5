"""Random instructions on the emulated core and on Unicorn, compared. See README.md."""

import argparse
import random
import subprocess
import sys
import time

import unicorn
from unicorn import arm_const as arm

CODE, RAM, RAM_BYTES, WINDOW, WINDOW_BYTES = 0x1000, 0x20000000, 32768, 0x20001000, 256
REGISTERS = [getattr(arm, f"UC_ARM_REG_R{n}") for n in range(13)] + [
    arm.UC_ARM_REG_SP,
    arm.UC_ARM_REG_LR,
    arm.UC_ARM_REG_PC,
]
MASK = 0xFFFFFFFF


def window(seed, halves):
    """Contents of the filled part of SRAM; the same function is in case.rs."""
    out = bytearray()
    for index in range(WINDOW_BYTES // 4):
        x = (seed + index * 0x9E3779B9) & MASK
        x = ((x ^ x >> 16) * 0x85EBCA6B) & MASK
        x = ((x ^ x >> 13) * 0xC2B2AE35) & MASK
        x ^= x >> 16
        if x & 3 == 0:
            x = CODE + (x >> 8) % halves * 2 + 1
        out += x.to_bytes(4, "little")
    return bytes(out)


class Generator:
    """Code and registers. No instruction whose effect the architecture leaves open, no system instruction."""

    def __init__(self, rng, halves):
        self.rng, self.halves = rng, halves

    def case(self, steps):
        r = self.rng
        code = []
        while len(code) < self.halves:
            code += self.instruction(len(code))
        code = code[: self.halves]
        if code[-1] >> 11 >= 0x1D and code[-2] >> 11 < 0x1D:
            code[-1] = 0xBF00
        registers = [self.value() for _ in range(13)]
        registers += [WINDOW + 4 * r.randrange(8, 56), self.value(), CODE + 2 * (self.halves // 3)]
        return dict(seed=r.getrandbits(32), steps=steps, code=code, apsr=r.getrandbits(4), r=registers)

    def value(self):
        r = self.rng
        kind = r.randrange(12)
        if kind < 4:
            return WINDOW + 4 * r.randrange(0, 60)
        if kind == 4:
            return WINDOW + r.randrange(0, 240)
        if kind == 5:
            return CODE + 2 * r.randrange(self.halves) + 1
        if kind == 6:
            return r.randrange(0, 40)
        if kind == 7:
            return 0x80000000 + r.randrange(-2, 3)
        if kind == 8:
            return -r.randrange(0, 4) & MASK
        return r.getrandbits(32)

    def target(self, at, low, high):
        """Offset in bytes from PC of a place in the code that a branch at halfword `at` reaches."""
        low = max(-(at + 2), low // 2)
        high = min(self.halves - 1 - (at + 2), high // 2)
        return 2 * self.rng.randint(low, high) if low <= high else None

    def instruction(self, at):
        r = self.rng
        bits = r.getrandbits(16)
        kind = r.randrange(32)
        if kind < 4:
            return [bits & 0x1FFF]
        if kind == 4:
            return [0x2000 | bits & 0x1FFF]
        if kind < 8:
            return [0x4000 | bits & 0x3FF]
        if kind == 8:
            d, m, op = bits & 7 | bits >> 4 & 8, bits >> 3 & 15, bits >> 8 & 3
            # SP is left out: Unicorn keeps its two low bits, which are zero on silicon.
            if op == 3 or d == 13 or d == 15 and (m == 15 or op != 2) or op == 1 and (d < 8 and m < 8 or m == 15):
                return self.instruction(at)
            return [0x4400 | bits & 0x3FF]
        if kind == 9:
            m = r.randrange(15)
            link = r.getrandbits(1)
            return [0x4700 | m << 3 | link << 7]
        if kind == 10:
            return [0x4800 | bits & 0x703]
        if kind < 14:
            return [0x5000 | bits & 0xFFF]
        if kind < 18:
            return [0x6000 | bits & 0x1FFF]
        if kind == 18:
            return [0x8000 | bits & 0xFFF]
        if kind == 19:
            return [0x9000 | bits & 0xF1F]
        if kind == 20:
            return [0xA000 | bits & 0xFFF]
        if kind == 21:
            return [0xB000 | bits & 0x87] if bits & 0x100 else [0xB200 | bits & 0xFF]
        if kind == 22:
            return [0xBA00 | bits & 0x3F | r.choice([0, 1, 3]) << 6]
        if kind < 25:
            low = bits & 0xFF
            if low == 0:
                return self.instruction(at)
            return [r.choice([0xB400, 0xB500, 0xBC00, 0xBC00, 0xBD00]) | low]
        if kind < 27:
            n, low, load = bits & 7, bits >> 8, r.getrandbits(1)
            if low == 0 or not load and low >> n & 1 and low & ((1 << n) - 1):
                return self.instruction(at)
            return [0xC000 | load << 11 | n << 8 | low]
        if kind < 29:
            offset = self.target(at, -256, 254)
            return [0xD000 | r.randrange(14) << 8 | offset >> 1 & 0xFF] if offset is not None else [0xBF00]
        if kind == 29:
            offset = self.target(at, -2048, 2046)
            return [0xE000 | offset >> 1 & 0x7FF] if offset is not None else [0xBF00]
        if kind == 30:
            offset = self.target(at, -(1 << 24), (1 << 24) - 2)
            if offset is None:
                return [0xBF00]
            s, i1, i2 = offset >> 24 & 1, offset >> 23 & 1, offset >> 22 & 1
            j1, j2 = 1 ^ i1 ^ s, 1 ^ i2 ^ s
            return [0xF000 | s << 10 | offset >> 12 & 0x3FF, 0xD000 | j1 << 13 | j2 << 11 | offset >> 1 & 0x7FF]
        pick = r.randrange(6)
        if pick == 0:
            return [0xF380 | r.randrange(13), 0x8800]
        if pick == 1:
            return [0xF3EF, 0x8000 | r.randrange(13) << 8]
        if pick == 2:
            return [0xF3BF, r.choice([0x8F4F, 0x8F5F, 0x8F6F])]
        return [r.choice([0xBF00, 0xBF10, 0xBF40])]


class Oracle:
    """Unicorn as a Cortex-M0 with the same memory."""

    def __init__(self):
        self.uc = uc = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        uc.ctl_set_cpu_model(arm.UC_CPU_ARM_CORTEX_M0)
        uc.mem_map(0, 256 * 1024, unicorn.UC_PROT_READ | unicorn.UC_PROT_EXEC)
        uc.mem_write(0, b"\xff" * 256 * 1024)
        uc.mem_write(0, bytes([0, 0x20, 0, 0x20, 1, 0x10, 0, 0]))
        uc.mem_map(RAM, RAM_BYTES)
        self.executed = 0
        uc.hook_add(unicorn.UC_HOOK_CODE, self.count)
        uc.hook_add(unicorn.UC_HOOK_INTR, self.interrupt)
        uc.hook_add(unicorn.UC_HOOK_MEM_READ | unicorn.UC_HOOK_MEM_WRITE, self.access)

    def count(self, uc, address, _size, _data):
        self.executed += 1
        # Unicorn's Cortex-M0 executes Thumb-2 too, which the middle of a BL and what surrounds the code may look like.
        if address in self.second_halves or not CODE <= address < self.end:
            return self.fault(uc)
        # Unicorn's APSR has the Q flag, bit 27, which ARMv6-M has not.
        half = self.code[(address - CODE) // 2]
        if half & 0xFFF0 == 0xF380 and uc.reg_read(REGISTERS[half & 15]) >> 27 & 1:
            self.fault(uc)

    def interrupt(self, uc, _number, _data):
        self.fault(uc)

    def access(self, uc, _kind, address, size, _value, _data):
        # Unicorn's Cortex-M0 carries out unaligned accesses, which fault on silicon.
        if address % size:
            self.fault(uc)

    def fault(self, uc):
        if self.faulted is None:
            self.faulted = self.executed
        uc.emu_stop()

    def run(self, case):
        """The result line; shortens the case to the steps before a fault. `None` if the first step faults."""
        while case["steps"] > 0:
            text = self.attempt(case)
            if text is not None:
                return text
            case["steps"] = min(self.faulted or self.executed, case["steps"]) - 1
        return None

    def attempt(self, case):
        uc, code = self.uc, b"".join(half.to_bytes(2, "little") for half in case["code"])
        before = bytearray(RAM_BYTES)
        fill = window(case["seed"], len(case["code"]))
        before[WINDOW - RAM : WINDOW - RAM + WINDOW_BYTES] = fill
        self.code = case["code"]
        self.second_halves, wide, self.end = set(), False, CODE + len(code)
        for at, half in enumerate(case["code"]):
            if wide:
                self.second_halves.add(CODE + 2 * at)
            wide = not wide and half >> 11 >= 0x1D
        uc.mem_write(CODE, code)
        uc.mem_write(RAM, bytes(before))
        uc.ctl_remove_cache(CODE, CODE + len(code))
        for register, value in zip(REGISTERS, case["r"]):
            uc.reg_write(register, value)
        uc.reg_write(arm.UC_ARM_REG_XPSR, case["apsr"] << 28 | 1 << 24)
        self.executed, self.faulted = 0, None
        try:
            uc.emu_start(case["r"][15] | 1, MASK - 1, 0, case["steps"])
        except unicorn.UcError:
            return None
        if self.faulted is not None:
            return None
        text = f"{uc.reg_read(arm.UC_ARM_REG_XPSR) >> 28:x}"
        for number, (register, old) in enumerate(zip(REGISTERS, case["r"])):
            new = uc.reg_read(register) & (~1 if number == 15 else MASK)
            if new != old:
                text += f" r{number}={new:x}"
        after = uc.mem_read(RAM, RAM_BYTES)
        if after != before:
            for at in range(0, RAM_BYTES, 4):
                if after[at : at + 4] != before[at : at + 4]:
                    text += f" {RAM + at:x}={int.from_bytes(after[at:at + 4], 'little'):x}"
        return text


def line(case):
    code = "".join(f"{half:04x}" for half in case["code"])
    registers = ",".join(f"{value:x}" for value in case["r"])
    return f"{case['seed']:x} {case['steps']} {code} {case['apsr']:x} {registers}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--emulator", required=True, help="path of the built example `oracle`")
    parser.add_argument("--instructions", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--halves", type=int, default=64, help="halfwords of code per case")
    parser.add_argument("--steps", type=int, default=32, help="instructions per case, at most")
    parser.add_argument("--write", help="also write cases and the oracle's results to this file")
    options = parser.parse_args()

    rng = random.Random(options.seed)
    generator, oracle = Generator(rng, options.halves), Oracle()
    cases, total, kinds, dropped, start = [], 0, {}, 0, time.time()
    while total < options.instructions:
        case = generator.case(options.steps)
        expected = oracle.run(case)
        if expected is None:
            dropped += 1
            continue
        cases.append((line(case), expected))
        total += case["steps"]
    stdin = "".join(text + "\n" for text, _ in cases)
    run = subprocess.run([options.emulator], input=stdin, capture_output=True, text=True, check=True)
    results = run.stdout.splitlines()
    wrong = [(c, e, g) for (c, e), g in zip(cases, results, strict=True) if e != g]
    for case, expected, got in wrong[:5]:
        print(f"case     {case}\nunicorn  {expected}\nemulated {got}\n")
    if options.write:
        with open(options.write, "w") as file:
            for case, expected in cases:
                file.write(f"{case} | {expected}\n")
    print(
        f"{total} instructions in {len(cases)} cases ({dropped} dropped: first step faults), "
        f"{len(wrong)} cases differ, Unicorn {unicorn.__version__}, {time.time() - start:.0f} s"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
