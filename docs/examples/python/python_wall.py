"""A wall in 25 lines: physics of your own, felt by the hand. Started by `rtbus run python_wall.yaml`."""
import numpy as np
import rtbus

FLOOR, UP, FRICTION = 0.0, np.array([0.0, 1.0, 0.0]), 0.4
RECOVERY = 0.1  # m/s: a tool that starts inside the wall leaves it no faster

with rtbus.Engine(gives_bodies=True, bodies=1) as engine:
    for step in engine:
        if step.index == 1:
            engine.body(0, position=(0, FLOOR, 0))  # it never moves: once is enough
            engine.shape(0, "plane")  # for the viewer
        for hand in step.hands:
            if hand.spring:  # the tool is a small mass on a spring; keep it out of the wall
                velocity, mass = hand.free_step(step.dt)
                deepest = FLOOR + hand.radius - hand.position[1]
                push = max(0.0, min(deepest / step.dt, RECOVERY) - velocity[1])
                velocity = velocity + push * UP
                force = mass * push * UP / step.dt
                hand.move(hand.position + step.dt * velocity, velocity, force)
            if hand.placed:  # the haptic loop keeps it out by itself: tell where the wall is
                x, y, z = hand.position
                gap = y - hand.radius - FLOOR
                if gap < hand.reach:
                    hand.contact(0, (x, FLOOR, z), UP, gap, FRICTION * hand.friction)
