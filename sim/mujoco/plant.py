#!/usr/bin/env python3
"""The robot's body in MuJoCo, for `sarah evaluate --plant "python3 sim/mujoco/plant.py"`.

Speaks the words of docs/sim-to-sim.md on standard input and output: a reply to every message, nothing else. Everything
about the robot is read from sim/assets/sarah.xml; nothing here is tuned to make it stand.
"""

import struct
import sys
import traceback
import zlib
from pathlib import Path
from typing import BinaryIO, NamedTuple

import mujoco
import numpy as np

VERSION = 1
XML = Path(__file__).resolve().parents[1] / "assets" / "sarah.xml"
JOINTS = ["l_abd", "l_hip", "l_knee", "r_abd", "r_hip", "r_knee"]
PADS = ["l_heel", "l_toe", "r_heel", "r_toe"]
# The file's own 1 ms is too long for its stiff pads: the standing robot bounces at 7 Hz for ever. At half of it, which
# is rapier's substep too, it stands still.
TIMESTEP_S = 0.0005
# Soles on the floor: MuJoCo's impedance, its shortest time constant, and a landing without rebound. Its damping ratio is
# that of the pad's 0.3 kg alone; the robot above is a hundred times as heavy and rebounds at half its speed with 1. Chosen
# by the braked robot alone, dropped and rocking; see docs/sim-to-sim.md.
SOLE_SOLREF = (2.0 * TIMESTEP_S, 20.0)
# Ends of travel and drives are as hard as the file has the brakes.
HARD_SOLREF = (0.002, 1.0)
HARD_SOLIMP = (0.99, 0.999, 0.001)


class Setup(NamedTuple):
    """What the robot differs in from the file."""

    model: bytes
    dt_s: float
    drop_m: float
    payload_kg: float
    com_shift_m: tuple[float, float, float]
    mass_scale: float
    friction: float
    slope_rad: tuple[float, float]
    speed_scales: tuple[float, ...]
    force_scales: tuple[float, ...]

    @staticmethod
    def read(body: bytes) -> "Setup":
        model, dt, drop, payload, x, y, z, mass, friction, pitch, roll, *scales = struct.unpack("<4s22f", body)
        speeds, forces = tuple(scales[:6]), tuple(scales[6:])
        return Setup(model, dt, drop, payload, (x, y, z), mass, friction, (pitch, roll), speeds, forces)


class Refused(Exception):
    """A setting that cannot be simulated: its name, and why."""


def load_cell(spec: mujoco.MjSpec, pad: str) -> None:
    """Measures the net force of the ground on `pad` in world axes."""
    geom = mujoco.mjtObj.mjOBJ_GEOM
    kind = mujoco.mjtSensor.mjSENS_CONTACT
    sensor = spec.add_sensor(name=pad, type=kind, objtype=geom, objname="ground", reftype=geom, refname=pad)
    # Data: force; reduction: net force; one of them.
    sensor.intprm[:3] = [1 << mujoco.mjtConDataField.mjCONDATA_FORCE.value, 3, 1]


class Plant:
    """A robot upright on straight legs, brakes on, as `setup` asks."""

    def __init__(self, setup: Setup, xml: str) -> None:
        spec = mujoco.MjSpec.from_string(xml)
        spec.option.timestep = TIMESTEP_S
        for pad in PADS:
            load_cell(spec, f"{pad}_pad")
        self.model = model = spec.compile()
        self.data = data = mujoco.MjData(model)
        # Single precision on the wire: 0.002 arrives as 0.0020000001.
        self.substeps = round(setup.dt_s / TIMESTEP_S)
        if self.substeps < 1 or abs(self.substeps * TIMESTEP_S - setup.dt_s) > 1e-6:
            raise Refused("dt_s", f"give a multiple of {TIMESTEP_S} s")
        self.trunk = model.body("trunk").id
        self.pads = np.array([model.geom(f"{pad}_pad").id for pad in PADS])
        self.ground = model.geom("ground").id
        self.motors = np.array([model.actuator(joint).id for joint in JOINTS])
        self.brakes = np.array([model.equality(f"{joint}_brake").id for joint in JOINTS])
        self.qpos = np.array([model.joint(joint).qposadr[0] for joint in JOINTS])
        self.qvel = np.array([model.joint(joint).dofadr[0] for joint in JOINTS])
        model.geom_solref[:] = SOLE_SOLREF
        model.jnt_solref[:] = model.dof_solref[:] = HARD_SOLREF
        model.jnt_solimp[:, :3] = model.dof_solimp[:, :3] = HARD_SOLIMP
        # The file's velocity actuators switch between plus and minus their limit at every timestep, as none is short
        # enough for their gain: they are off, and `step` drives the joints.
        model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0.0
        self.speed = model.actuator_ctrlrange[self.motors, 1] * setup.speed_scales
        self.force = model.actuator_forcerange[self.motors, 1] * setup.force_scales
        self.efforts = np.zeros(6)
        self.loads = np.zeros(4)
        self._masses(setup)
        self._ground(setup)
        mujoco.mj_setConst(model, data)
        mujoco.mj_resetData(model, data)
        # Rigid feet stand flat on a slope only if the legs are square to it.
        at, turned = data.qpos[:3].copy(), data.qpos[3:7].copy()
        mujoco.mju_rotVecQuat(data.qpos[:3], at, self.turn)
        mujoco.mju_mulQuat(data.qpos[3:7], self.turn, turned)
        mujoco.mj_forward(model, data)
        lift = max(-corner @ self.normal / self.normal[2] for corner in self._soles())
        data.qpos[2] += setup.drop_m + lift
        mujoco.mj_forward(model, data)

    def _masses(self, setup: Setup) -> None:
        model = self.model
        model.body_mass *= setup.mass_scale
        model.body_inertia *= setup.mass_scale
        model.body_mass[self.trunk] += setup.payload_kg
        model.body_ipos[self.trunk] += setup.com_shift_m

    def _ground(self, setup: Setup) -> None:
        model, (pitch, roll) = self.model, setup.slope_rad
        about_y, about_x = np.zeros(4), np.zeros(4)
        self.turn = np.zeros(4)
        mujoco.mju_axisAngle2Quat(about_y, [0.0, 1.0, 0.0], pitch)
        mujoco.mju_axisAngle2Quat(about_x, [1.0, 0.0, 0.0], roll)
        mujoco.mju_mulQuat(self.turn, about_y, about_x)
        at = model.geom_pos[self.ground].copy()
        mujoco.mju_rotVecQuat(model.geom_pos[self.ground], at, self.turn)
        model.geom_quat[self.ground] = self.turn
        self.normal = np.zeros(3)
        mujoco.mju_rotVecQuat(self.normal, [0.0, 0.0, 1.0], self.turn)
        if not np.isnan(setup.friction):
            model.geom_friction[[*self.pads, self.ground], 0] = setup.friction

    def _soles(self) -> list[np.ndarray]:
        """Lower corners of the pads in the world, m."""
        corners = []
        for pad in self.pads:
            x, y, z = self.model.geom_size[pad]
            turn = self.data.geom_xmat[pad].reshape(3, 3)
            for corner in [(x, y, -z), (x, -y, -z), (-x, y, -z), (-x, -y, -z)]:
                corners.append(self.data.geom_xpos[pad] + turn @ corner)
        return corners

    def step(self, body: bytes) -> None:
        """Advances by `dt_s` with these drives and this push."""
        released_bits, *values = struct.unpack("<B10f", body)
        model, data = self.model, self.data
        released = np.array([released_bits >> joint & 1 for joint in range(6)], dtype=bool)
        held = data.eq_active[self.brakes].astype(bool)
        # A brake locks its joint where it is when it is applied.
        for joint in np.flatnonzero(~released & ~held):
            model.eq_data[self.brakes[joint], 0] = data.qpos[self.qpos[joint]]
        data.eq_active[self.brakes] = ~released
        # A released joint is a friction, limited as the motor's force is, that brings it to the commanded speed.
        model.dof_frictionloss[self.qvel] = self.force * released
        speeds = np.clip(values[:6], -self.speed, self.speed)[released]
        force = np.array(values[6:9])
        data.xfrc_applied[self.trunk, :3] = force
        data.xfrc_applied[self.trunk, 3:] = np.cross([0.0, 0.0, values[9]], force)
        forces, efforts = np.zeros(12), np.zeros(np.count_nonzero(released))
        for _ in range(self.substeps):
            mujoco.mj_step1(model, data)
            # Frictions come after brakes, in the order of the joints. Their reference acceleration is -b v; that of a
            # drive is -b (v - speed).
            drives = slice(data.ne, data.ne + data.nf)
            data.efc_aref[drives] += data.efc_KBIP[drives, 1] * speeds
            mujoco.mj_step2(model, data)
            forces += data.sensordata
            efforts += data.efc_force[drives]
        self.loads = forces.reshape(4, 3) @ self.normal / self.substeps
        self.efforts = np.zeros(6)
        self.efforts[released] = efforts / self.substeps

    def snapshot(self) -> bytes:
        """35 floats."""
        qpos, qvel = self.data.qpos, self.data.qvel
        # MuJoCo: w first, and the angular velocity of a free joint in its own axes.
        spin = np.zeros(3)
        mujoco.mju_rotVecQuat(spin, qvel[3:6], qpos[3:7])
        state = [qpos[:3], qpos[4:7], qpos[3:4], qvel[:3], spin, qpos[self.qpos], qvel[self.qvel], self.efforts, self.loads]
        return np.concatenate(state).astype("<f4").tobytes()


def stuffed(raw: bytes) -> bytes:
    """COBS of less than 254 bytes: each zero becomes the distance to the next."""
    return b"".join(bytes([len(part) + 1]) + part for part in raw.split(b"\0"))


def unstuffed(data: bytes) -> bytes:
    """Undoes `stuffed`."""
    parts, at = [], 0
    while at < len(data):
        parts.append(data[at + 1 : at + data[at]])
        at += data[at]
    return b"\0".join(parts)


def frames(source: BinaryIO):
    """Version, number and body of every frame that arrives whole."""
    pending = b""
    while chunk := source.read1(4096):
        *whole, pending = (pending + chunk).split(b"\0")
        for raw in map(unstuffed, filter(None, whole)):
            if len(raw) >= 9 and zlib.crc32(raw[:-4]) == int.from_bytes(raw[-4:], "little"):
                version, _, number = struct.unpack("<BHH", raw[:5])
                yield version, number, raw[5:-4]


def main() -> None:
    text = XML.read_bytes()
    crc = struct.pack("<I", zlib.crc32(text))
    name = f"mujoco {mujoco.__version__}".encode()
    plant: Plant | None = None
    for version, number, body in frames(sys.stdin.buffer):
        if version != VERSION:
            reply = b""
        elif body[0] == 0:
            try:
                plant = Plant(Setup.read(body[1:]), text.decode())
                reply = b"\0" + crc + plant.snapshot() + bytes([len(name)]) + name
            except Refused as refusal:
                reply = b"\2" + b"".join(bytes([len(word)]) + word.encode() for word in refusal.args)
        elif plant is not None:
            plant.step(body[1:])
            reply = b"\1" + plant.snapshot()
        else:
            sys.exit("a step before a setup: nothing stands there yet")
        raw = struct.pack("<BHH", VERSION, 0, number) + reply
        sys.stdout.buffer.write(b"\0" + stuffed(raw + struct.pack("<I", zlib.crc32(raw))) + b"\0")
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
