"""Makes an MJCF file touchable: mujoco_python.py MODEL.xml, with the MuJoCo library of your own.

Started by `rtbus run mujoco_python.yaml`. MuJoCo's world gets y up: write the model so, or turn it with the session's
mapping. The haptic loop simulates the tool (method: local_contact); MuJoCo finds what is near it with a ball that carries
no force. The library is the Python package `mujoco`, or else Debian's, by debian_mujoco.py beside this file.
"""
import os
import sys
import tempfile

import numpy as np
import rtbus

try:
    import mujoco
except ImportError:
    import debian_mujoco as mujoco

GRAVITY = (0.0, -9.81, 0.0)
TURNED = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # MuJoCo's planes, capsules and cylinders stand along z, ours along y


def load(path, hands, reach):
    """The model with a ball per hand, which lists contacts within its margin and never pushes (gap > margin)."""
    slides = "".join(f'<joint name="tool_%s_{name}" type="slide" axis="{axis}"/>'
                     for name, axis in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1")))
    balls = "".join(f'<body name="tool_{hand.name}">{slides.replace("%s", hand.name)}<geom name="tool_{hand.name}" '
                    f'type="sphere" size="{max(hand.radius, 1e-4)}" friction="0 0 0" margin="{reach}" gap="1"/></body>'
                    for hand in hands)
    with open(path) as file:
        head, end, tail = file.read().rpartition("</worldbody>")
    # Beside the model, so that files it names are found.
    with tempfile.NamedTemporaryFile("w", suffix=".xml", dir=os.path.dirname(os.path.abspath(path))) as file:
        file.write(head + balls + end + tail)
        file.flush()
        model = mujoco.MjModel.from_xml_path(file.name)
    model.opt.gravity[:] = GRAVITY
    return model


def tell_shapes(engine, model, data):
    """What the bodies look like, for viewers: all but meshes, ellipsoids and height fields."""
    kinds = {mujoco.mjtGeom.mjGEOM_PLANE: "plane", mujoco.mjtGeom.mjGEOM_SPHERE: "sphere", mujoco.mjtGeom.mjGEOM_BOX: "box",
             mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule", mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder"}
    for geom in range(model.ngeom):
        body, kind, (a, b, c) = int(model.geom_bodyid[geom]), kinds.get(model.geom_type[geom]), model.geom_size[geom]
        if kind is None or body >= engine.bodies:
            continue
        size = {"plane": (), "sphere": a, "box": (a, b, c), "capsule": (a, 2 * (a + b)), "cylinder": (a, 2 * b)}[kind]
        axes = data.ximat[body].reshape(3, 3)
        turn, turned = np.zeros(4), axes.T @ data.geom_xmat[geom].reshape(3, 3)
        if kind in ("plane", "capsule", "cylinder"):
            turned = turned @ TURNED
        mujoco.mju_mat2Quat(turn, np.ascontiguousarray(turned).reshape(9))
        engine.shape(body, kind, size, axes.T @ (data.geom_xpos[geom] - data.xipos[body]), turn)


def place(model, data, hand):
    """Puts the ball where the hand's tool is."""
    first = model.joint(f"tool_{hand.name}_x")
    data.qpos[first.qposadr[0] : first.qposadr[0] + 3] = hand.target
    data.qvel[first.dofadr[0] : first.dofadr[0] + 3] = hand.target_velocity


def tell_bodies(engine, model, data):
    """Where the bodies are, and what acts on them besides the tool."""
    bodies = engine.bodies  # the tools come after them
    force = model.body_mass[:bodies, None] * model.opt.gravity
    torque, rub, rub_torque, bound = (np.zeros((bodies, 3)), np.zeros((bodies, 3)), np.zeros((bodies, 3)), np.zeros(bodies))
    loads, wrench = [], np.zeros(6)
    for i, contact in enumerate(data.contact[: data.ncon]):
        if contact.efc_address < 0:
            continue
        mujoco.mj_contactForce(model, data, i, wrench)
        axes = contact.frame.reshape(3, 3)
        for geom, other, sign in ((contact.geom2, contact.geom1, 1.0), (contact.geom1, contact.geom2, -1.0)):
            body, holds = model.geom_bodyid[geom], model.geom_bodyid[other]
            if model.body_dofnum[body] == 0 or wrench[0] <= 0.0 or max(body, holds) >= bodies:
                continue
            arm = contact.pos - data.xipos[body]
            push, slide = sign * wrench[0] * axes[0], sign * (wrench[1] * axes[1] + wrench[2] * axes[2])
            force[body] += push
            torque[body] += np.cross(arm, push)
            rub[body] += slide
            rub_torque[body] += np.cross(arm, slide)
            bound[body] += contact.friction[0] * wrench[0]
            loads.append((body, holds, contact.pos.copy(), sign * axes[0], wrench[0], contact.friction[0]))
    velocity, turn = np.zeros(6), np.zeros(4)
    for body in range(bodies):
        mujoco.mju_mat2Quat(turn, data.ximat[body])
        if model.body_dofnum[body] == 0:
            engine.body(body, data.xipos[body], turn)
            continue
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        engine.body(body, data.xipos[body], turn, velocity[3:], velocity[:3], kind="dynamic", mass=model.body_mass[body],
                    inertia=model.body_inertia[body], force=force[body], torque=torque[body], friction_force=rub[body],
                    friction_torque=rub_torque[body], friction_bound=bound[body])
    for body, holds in {(body, holds) for body, holds, *_ in loads}:
        rows = [row[2:] for row in loads if row[:2] == (body, holds)]
        total = sum(row[2] for row in rows)
        normal = sum(row[2] * row[1] for row in rows)
        engine.support(body, sum(row[2] * row[0] for row in rows) / total, normal / np.linalg.norm(normal), total,
                       rows[0][3], len(rows), inverse_mass=0.0 if model.body_dofnum[holds] == 0 else 1 / model.body_mass[holds])


def tell_contacts(model, data, hand):
    """What is near the tool."""
    tool = model.geom(f"tool_{hand.name}").id
    for contact in data.contact[: data.ncon]:
        if tool not in (contact.geom1, contact.geom2):
            continue
        body_geom, sign = (contact.geom1, 1.0) if contact.geom2 == tool else (contact.geom2, -1.0)
        normal = sign * contact.frame[:3]
        hand.contact(model.geom_bodyid[body_geom], contact.pos - 0.5 * contact.dist * normal, normal, contact.dist,
                     contact.friction[0] * hand.friction)


def main(path):
    bodies = mujoco.MjModel.from_xml_path(path).nbody
    with rtbus.Engine(gives_bodies=True, bodies=bodies) as engine:
        model = load(path, engine.hands, max(2e-3, engine.dt))
        data = mujoco.MjData(model)
        parts = max(1, round(engine.dt / model.opt.timestep))
        model.opt.timestep = engine.dt / parts
        for step in engine:
            data.xfrc_applied[:] = 0
            for hand in step.hands:
                place(model, data, hand)
                for body, force, torque in hand.pushes:
                    data.xfrc_applied[body] += (*force, *torque)
                if hand.spring:  # before the first contact of the loop: no force, the tool follows the hand
                    hand.move(hand.target, hand.target_velocity)
            mujoco.mj_step(model, data, parts)
            for hand in step.hands:
                place(model, data, hand)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            tell_bodies(engine, model, data)  # with the forces of the step's contacts, which mj_collision() forgets
            if step.index == 1:
                tell_shapes(engine, model, data)
            mujoco.mj_collision(model, data)
            for hand in step.hands:
                if hand.placed:
                    tell_contacts(model, data, hand)


if __name__ == "__main__":
    main(sys.argv[1])
