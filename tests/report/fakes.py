"""A small stand-in for a finished study: the attributes that figures and tables read."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from mrac_design.simulation.scenario import load_scenario

AXES = ("X", "Y", "Z")
GAINS = ("r1'", "s0", "s1", "t0", "t1", "bias")


class FakeTrajectory:
    """Named signals over a common time, as `mrac_design.simulation.Trajectory`."""

    def __init__(self, time, signals, events=()):
        self.time = time
        self.events = events
        self.signals = signals

    def __getitem__(self, name):
        return self.signals[name].values


def signal(values, labels, unit):
    return SimpleNamespace(values=values, labels=tuple(labels), unit=unit, description="")


def fake_trajectory(error_scale, model_scale, moving, samples=2001):
    time = np.linspace(0, 8, samples)
    phase = 2 * np.pi * np.outer(time, [0.83, 0.83, 0.83]) + [0, 1, 2]
    heart = np.array([0.5, -0.03, -0.3]) + 1e-3 * np.sin(phase) * [2.3, 0.9, 1.5]
    desired = np.where(np.sin(2 * np.pi * time / 3)[:, None] > 0, 1.5, 1.0) * [1, 1, 1.3]
    model = desired - 0.001 * model_scale
    force = desired + error_scale * np.cos(phase)
    drift = moving * np.outer(1 - np.exp(-time), [0.1, -0.2, 0.05, 0.02, 0.03, 0])
    gains = np.tile(np.array([1.9, 2.71, 1, 1, 1, 0]) + drift, (1, 3))
    torque = np.outer(np.ones(samples), [14, 2, 1, 0.1, 0.05]) * (1 + 0.1 * np.cos(phase[:, :1]))
    return FakeTrajectory(
        time,
        {
            "force": signal(force, AXES, "N"),
            "desired_force": signal(desired, AXES, "N"),
            "model_force": signal(model, AXES, "N"),
            "force_reference": signal(desired, AXES, "N"),
            "heart": signal(heart, AXES, "m"),
            "tip": signal(heart + force / 800, AXES, "m"),
            "torque": signal(torque, [f"joint {i + 1}" for i in range(5)], "N·m"),
            "adapted_gains": signal(gains, [f"{a} {g}" for a in AXES for g in GAINS], "–"),
            "jacobian_condition": signal(6.7 + 0 * time[:, None], ["condition"], "–"),
        },
    )


def fake_study():
    trajectories = {
        "frozen": fake_trajectory(0.036, 1.0, 0),
        "adaptive": fake_trajectory(0.034, 0.3, 1),
        "adaptive_inverse": fake_trajectory(0.003, 0.1, 1),
    }
    tracking = {
        variant: {
            axis: SimpleNamespace(
                max_force_error_percent=100 * scale / 1.5,
                max_force_error_N=scale,
                rms_force_error_N=scale / 1.41,
                max_model_error_N=scale,
                rms_model_error_N=scale / 3,
                max_desired_force_N=1.5,
            )
            for axis in AXES
        }
        for variant, scale in (("frozen", 0.036), ("adaptive", 0.034), ("adaptive_inverse", 0.003))
    }
    joints = tuple(SimpleNamespace(name=f"joint {i + 1}") for i in range(5))
    heart = trajectories["frozen"]["heart"]
    return SimpleNamespace(
        scenario=load_scenario("nominal"),
        robot=SimpleNamespace(
            name="D2M2 stand-in",
            force_axes=AXES,
            joints=joints,
            motor_torque_limits=np.array([150.0, 150, 150, 20, 10]),
            task=SimpleNamespace(position=(0, 1, 2)),
        ),
        motion=SimpleNamespace(
            origin=SimpleNamespace(value="fitted"),
            source="a fake",
            displacement=lambda time: (heart - heart.mean(axis=0)).T[:, : time.size],
        ),
        trajectories=trajectories,
        tracking=tracking,
        max_torque={
            variant: {f"joint {i + 1}": 10.0 / (i + 1) for i in range(5)} for variant in tracking
        },
    )
