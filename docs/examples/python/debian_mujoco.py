"""The part of MuJoCo's Python interface that mujoco_python.py uses, on Debian's library (2.2).

    sudo apt install libmujoco-dev python3-cffi python3-numpy cpp

Debian packages no Python interface. This one reads the C headers, so the fields are those of the installed version.
Arrays are views into MuJoCo's memory, as in the interface of its makers.
"""
import os
import subprocess
import sys
from types import SimpleNamespace

import cffi
import numpy as np

FUNCTIONS = """
mjModel* mj_loadXML(const char*, const void*, char*, int);   mjData* mj_makeData(const mjModel*);
void mj_step(const mjModel*, mjData*);                        void mj_kinematics(const mjModel*, mjData*);
void mj_comPos(const mjModel*, mjData*);                      void mj_comVel(const mjModel*, mjData*);
void mj_collision(const mjModel*, mjData*);
void mj_contactForce(const mjModel*, const mjData*, int, double*);
void mj_objectVelocity(const mjModel*, const mjData*, int, int, double*, int);
void mju_mat2Quat(double*, const double*);                    int mj_name2id(const mjModel*, int, const char*);
extern void (*mju_user_error)(const char*);                   extern void (*mju_user_warning)(const char*);
"""
COLUMNS = {"body_inertia": 3, "geom_size": 3, "xfrc_applied": 6, "xipos": 3, "ximat": 9, "geom_xpos": 3, "geom_xmat": 9}
ROWS = {"body": "nbody", "geom": "ngeom", "jnt": "njnt", "qpos": "nq", "qvel": "nv", "xfrc": "nbody", "xipos": "nbody",
        "ximat": "nbody"}

_headers = "#include <mujoco/mjmodel.h>\n#include <mujoco/mjdata.h>\n"
_ffi = cffi.FFI()
_ffi.cdef("typedef unsigned char uint8_t; typedef unsigned long uintptr_t;" + subprocess.run(
    ["cpp", "-P", "-"], input=_headers, capture_output=True, text=True, check=True).stdout + FUNCTIONS, override=True)
_lib = _ffi.dlopen("libmujoco.so")


@_ffi.callback("void(const char*)")
def _on_error(text):  # without it MuJoCo waits for a key
    print("MuJoCo:", _ffi.string(text).decode(), file=sys.stderr, flush=True)
    os._exit(1)


@_ffi.callback("void(const char*)")
def _on_warning(text):
    print("MuJoCo:", _ffi.string(text).decode(), file=sys.stderr)


_lib.mju_user_error, _lib.mju_user_warning = _on_error, _on_warning
mjtObj = SimpleNamespace(mjOBJ_BODY=1, mjOBJ_JOINT=3, mjOBJ_GEOM=5)
mjtGeom = SimpleNamespace(mjGEOM_PLANE=0, mjGEOM_SPHERE=2, mjGEOM_CAPSULE=3, mjGEOM_CYLINDER=5, mjGEOM_BOX=6)


def _array(pointer, count):
    kind = {"double *": "f8", "int *": "i4"}[_ffi.typeof(pointer).cname]
    return np.frombuffer(_ffi.buffer(pointer, count * np.dtype(kind).itemsize), kind)


class _Struct:
    """Fields of a C structure: numbers as they are, arrays as numpy views with a row per body, geom, …"""

    def __getattr__(self, name):
        value = getattr(self.raw, name)
        if not isinstance(value, _ffi.CData) or name not in COLUMNS and name.split("_")[0] not in ROWS:
            return value
        columns = COLUMNS.get(name, 1)
        array = _array(value, getattr(self.sizes, ROWS[name.split("_")[0]]) * columns)
        array = array if columns == 1 else array.reshape(-1, columns)
        setattr(self, name, array)  # the memory stays where it is
        return array


class _Options:
    def __init__(self, raw):
        self._raw, self.gravity = raw, np.frombuffer(_ffi.buffer(raw.gravity), "f8")

    timestep = property(lambda self: self._raw.timestep, lambda self, value: setattr(self._raw, "timestep", value))


class MjModel(_Struct):
    @staticmethod
    def from_xml_path(path):
        why = _ffi.new("char[1000]")
        made = MjModel()
        made.raw = made.sizes = _lib.mj_loadXML(str(path).encode(), _ffi.NULL, why, 1000)
        if made.raw == _ffi.NULL:
            raise ValueError(_ffi.string(why).decode())
        made.opt = _Options(made.raw.opt)
        return made

    def joint(self, name):
        at = _lib.mj_name2id(self.raw, mjtObj.mjOBJ_JOINT, name.encode())
        return SimpleNamespace(id=at, qposadr=self.jnt_qposadr[at : at + 1], dofadr=self.jnt_dofadr[at : at + 1])

    def geom(self, name):
        return SimpleNamespace(id=_lib.mj_name2id(self.raw, mjtObj.mjOBJ_GEOM, name.encode()))


class MjData(_Struct):
    def __init__(self, model):
        self.raw, self.sizes = _lib.mj_makeData(model.raw), model.raw

    @property
    def contact(self):
        rows = (self.raw.contact[i] for i in range(self.raw.ncon))
        return [SimpleNamespace(dist=row.dist, pos=np.array(list(row.pos)), frame=np.array(list(row.frame)),
                                friction=list(row.friction), geom1=row.geom1, geom2=row.geom2, efc_address=row.efc_address)
                for row in rows]


def _doubles(array):
    return _ffi.cast("double*", _ffi.from_buffer(array))


def mj_step(model, data, nstep=1):
    for _ in range(nstep):
        _lib.mj_step(model.raw, data.raw)


def mj_kinematics(model, data):
    _lib.mj_kinematics(model.raw, data.raw)


def mj_comPos(model, data):
    _lib.mj_comPos(model.raw, data.raw)


def mj_comVel(model, data):
    _lib.mj_comVel(model.raw, data.raw)


def mj_collision(model, data):
    _lib.mj_collision(model.raw, data.raw)


def mj_contactForce(model, data, index, out):
    _lib.mj_contactForce(model.raw, data.raw, index, _doubles(out))


def mj_objectVelocity(model, data, kind, index, out, local):
    _lib.mj_objectVelocity(model.raw, data.raw, kind, index, _doubles(out), local)


def mju_mat2Quat(out, matrix):
    _lib.mju_mat2Quat(_doubles(out), _doubles(matrix))
