"""A random muscle against a spring or under a load, or a joint of two, and its runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mckibben import Recording
from mckibben.arrays import Array
from tests.plants.sampled import motions, physics
from tests.plants.sampled.draws import Truth, by_pressure, draw_friction, draw_law, draw_rate
from tests.plants.sampled.physics import Resistance, Slope

GRAVITY = 9.81


class Bench:
    """One random plant.

    Parameters
    ----------
    rng : Generator
    rig : {"spring", "load", "joint"}
    law, friction, rate : str
        Of `draws.LAWS`, `draws.FRICTIONS` and `draws.RATES`.
    phenomenon : {"", "wall", "dead zone", "asymmetry", "mass", "slack"}
    variant : int
        Which of the forms that a phenomenon has.
    payload : bool, optional
        Whether a load varies; default of a muscle under a load alone.
    gravity : bool
        Whether the torque of a joint is the payload moment * cos(angle).
    dt, filling : float, optional
        Sample time and time constant of the pressure inside [s]; default random.
    limit_rate : bool
        Whether the pressure inside is limited in speed.
    lift_mass : bool
        Whether loads have their inertia.
    sensors : Generator, optional
        Draws other noise for the same plant and motions.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        rig: str,
        law: str,
        friction: str,
        rate: str,
        phenomenon: str = "",
        variant: int = 0,
        *,
        payload: bool | None = None,
        gravity: bool = False,
        dt: float | None = None,
        limit_rate: bool = False,
        filling: float | None = None,
        lift_mass: bool = False,
        sensors: np.random.Generator | None = None,
    ) -> None:
        self.rng, self.kind, self.phenomenon = rng, rig, phenomenon
        self.joint, self.variant = rig == "joint", variant
        self.gravity, self.lift_mass, self.sensors = gravity, lift_mass, sensors
        self.payload = (rig == "load") if payload is None else payload
        self.rest = rng.uniform(100, 320)
        self.law, muscle = draw_law(rng, law, self.rest)
        self.truth: Truth = {"rig": rig, "muscle": muscle, "phenomenon": phenomenon or "none"}
        self.top = rng.uniform(3.0, 6.0)
        self.blocked, self.limit = muscle["blocked_N_per_bar"], muscle["largest_contraction"]
        stretched = self.limit * self.rest
        self.rubber = self.blocked * self.top / stretched * rng.uniform(0.03, 0.1)
        self.rubber3 = self.rubber * rng.uniform(0, 2) / stretched**2
        self.spring = self.spring3 = self.slack = self.mass = 0.0
        self.wall: tuple[float, float, int] | None = None
        self.radius = 1.0  # mm, of the pulley
        self._set_up()
        if phenomenon == "dead zone":
            self._deaden()
        if phenomenon == "mass" and rig == "spring":
            self.low = 0.2 * self.top
        if self.joint:
            self._gear()
        self.travel = self._travel()
        if phenomenon == "slack":
            self._loosen()
            self.travel = self._travel()
        middle = 0.5 * (self.low + self.high)
        at = self._at(middle), self._both(middle), self._usual()
        self.stiffness = -self.balance(*at)[1]
        if self.joint and self.payload:  # N m
            self.heaviest = 0.12 * self.stiffness * self.travel * self.radius * 1e-3
            self.lightest = 0.0 if gravity else -self.heaviest
        self._resist(friction, rate, filling, limit_rate)
        self._watch(dt)

    # How it is drawn, in this order.

    def _set_up(self) -> None:
        """Draw what the muscle works against, and how pressure goes: ``low`` to ``high``."""
        rng = self.rng
        self.high = self.top
        if self.kind == "spring":
            self.low, reach = rng.uniform(0.0, 0.4), self.limit * rng.uniform(0.3, 0.55) * self.rest
            force = self.law(self.top, reach)[0]
            self.spring = max(0.3 * self.rubber, force / reach - self.rubber)
            self.spring3 = float(rng.choice([0.0, 0.3, -0.1])) * self.spring / reach**2
            self.truth["spring_N_per_mm"] = self.spring
            self.truth["spring_N_per_mm3"] = self.spring3
        elif self.kind == "load":
            self.low = rng.uniform(1.0, 1.6)
            self.heaviest = rng.uniform(0.25, 0.4) * self.low * self.blocked
            self.lightest = rng.uniform(0.1, 0.5) * self.heaviest
        else:  # half the difference of pressures
            self.centre = self.limit * rng.uniform(0.28, 0.4) * self.rest
            self.bias, share = 0.5 * self.top, rng.uniform(0.5, 0.8)
            self.low, self.high = -share * self.bias, share * self.bias

    def _deaden(self) -> None:
        threshold = self.top * self.rng.uniform(0.13, 0.25)
        self.low = 0.0
        if self.joint:
            self.low, self.high = -0.92 * self.bias, 0.92 * self.bias
        if self.kind == "load":  # so light that the rubber can hold it alone
            self.heaviest = 0.35 * self.rubber * self.rest * self.limit
            self.lightest = 0.3 * self.heaviest
        self.law = physics.with_threshold(self.law, threshold)
        self.truth["threshold_bar"] = threshold

    def _gear(self) -> None:
        """Draw the pulley; no muscle is to push, or to leave 0.1 to 0.9 of its stroke."""
        for _ in range(30):
            s = self._at(self.high)
            pull = self._least_pull(self._both(self.high), s)
            room = min(self.centre, self.limit * self.rest - self.centre)
            if s < 0.9 * room and pull > 0.03 * self.blocked * self.bias:
                break
            if self.phenomenon == "dead zone":
                break
            self.low, self.high = 0.92 * self.low, 0.92 * self.high
        self.radius = self._travel() / self.rng.uniform(0.7, 1.6)
        self.truth["pulley_radius_mm"] = self.radius
        self.truth |= {"centre_contraction_mm": self.centre, "bias_bar": self.bias}

    def _loosen(self) -> None:
        """Draw slack: of the cable to the spring, or of both muscles of a joint."""
        rng, travel = self.rng, self.travel
        slack = travel * rng.uniform(0.15, 0.3)
        if self.joint:
            slack = travel * rng.uniform(0.12, 0.2)
            # rubber that takes all of a muscle's pull at a share of the bias; below, nothing pulls
            self.low, self.high = -0.96 * self.bias, 0.96 * self.bias
            at, low = self.centre + slack, rng.uniform(0.45, 0.6) * self.bias
            self.rubber = self.law(low, at)[0] / at
        else:
            self.low = self.spring3 = 0.0
            if self.variant % 2:  # free, soft motion, then a spring that is far stiffer
                slack = travel * rng.uniform(0.4, 0.55)
                self.spring *= rng.uniform(3.0, 4.0)
            share = rng.uniform(0.24, 0.32) if self.variant % 2 else rng.uniform(0.14, 0.22)
            self.rubber = self.law(share * self.top, slack)[0] / slack
            self.cable = self.spring * rng.uniform(15, 40)
            self.truth |= {"spring_N_per_mm": self.spring, "spring_N_per_mm3": 0.0}
            self.truth["cable_N_per_mm"] = self.cable
            self.truth["displacement_of"] = "muscle" if self.variant % 2 else "load"
        self.rubber3, self.slack = 0.0, slack
        of = "both cables" if self.joint else "cable between muscle and spring"
        self.truth |= {"slack_mm": slack, "slack_of": of}

    def _resist(self, friction: str, rate: str, filling: float | None, limit_rate: bool) -> None:
        """Draw friction, viscoelasticity, filling and mass."""
        rng, phenomenon, ratio = self.rng, self.phenomenon, 1.0
        if phenomenon == "asymmetry":
            ratio = rng.uniform(1.7, 3.0)
            ratio = 1 / ratio if self.variant % 2 else ratio
        width = rng.uniform(0.02, 0.07)
        if phenomenon == "slack":
            width = rng.uniform(0.01, 0.03)
        if phenomenon == "mass":
            width = rng.uniform(0.006, 0.015)
        if phenomenon == "asymmetry":
            width = rng.uniform(0.05, 0.08) / math.sqrt(ratio)
        force = width * self.stiffness * self.travel
        drawn = draw_friction(rng, friction, force, self.travel, ratio)
        resistance, self.truth["friction"] = drawn
        dashpot, resistance.prony, self.truth["rate"] = draw_rate(rng, rate, self.stiffness)
        often = [0.0, 0.0, 0.03, 0.08, 0.2]
        self.filling = float(rng.choice(often)) if filling is None else filling
        if phenomenon:
            self.filling = min(self.filling, 0.05)
        self.pressure_rate = rng.uniform(2.5, 5) * self.top if limit_rate else 0.0
        substep = 0.01
        if phenomenon == "mass":
            substep = 0.0025
            self._weigh(resistance)
        elif self.lift_mass:
            substep = 0.005
            heaviest = self.stiffness * 1e-3 * self.heaviest / GRAVITY
            resistance.dashpot += 2 * 0.12 * math.sqrt(heaviest)
        resistance.dashpot += dashpot
        self.rig = physics.Rig(
            *(self.balance, resistance, self.mass, self.filling, self.pressure_rate),
            substep=substep,
        )
        if friction == "pressure_scaled":
            base, bar = rng.uniform(0.2, 0.6), 0.5 * self.top
            self.rig.scale = by_pressure(base, bar)
            scales = f"by {base:.3f} + {1 - base:.3f} * mean pressure / {bar:.3f} bar"
            self.truth["friction"]["scales"] = scales

    def _weigh(self, resistance: Resistance) -> None:
        """Draw a mass that is seen: a little damped, of few Hz."""
        rng = self.rng
        self.filling = float(rng.uniform(0.015, 0.04))
        natural, damping = 2 * math.pi * rng.uniform(2.5, 6.0), rng.uniform(0.04, 0.1)
        if self.kind == "load":
            kilograms = 0.5 * (self.heaviest + self.lightest) / GRAVITY
            natural = math.sqrt(1e3 * self.stiffness / kilograms)
            self.lift_mass = True
            self.truth["mass_kg"] = [self.lightest / GRAVITY, self.heaviest / GRAVITY]
            self.truth["mass_note"] = "force / 9.81 of every run"
        else:
            kilograms = 1e3 * self.stiffness / natural**2
            self.truth["mass_kg"] = kilograms
        if self.joint:
            self.truth["mass_note"] = "at the pulley's radius"
            self.truth["inertia_kg_m2"] = kilograms * self.radius**2 * 1e-6
        resistance.dashpot += 2 * damping * math.sqrt(self.stiffness * kilograms * 1e-3)
        self.mass, self.natural = kilograms, natural / 2 / math.pi
        self.truth |= {"resonance_Hz": self.natural, "damping_ratio": damping}
        self.truth["dashpot_N_s_per_mm"] = resistance.dashpot

    def _watch(self, dt: float | None) -> None:
        """Draw the sample time, noise, and which pressure is recorded."""
        rng, joint = self.rng, self.joint
        self.dt = dt or float(rng.choice([0.01, 0.02, 0.02, 0.04]))
        if self.phenomenon == "mass":
            self.dt = float(rng.choice([0.005, 0.01]))
        self.inner = bool(rng.random() < 0.5)
        self.pace = rng.uniform(1.5, 5.0)  # s a stroke
        self.noise = str(rng.choice(["none", "white", "white", "quantised"]))
        sizes = {"none": 0.0, "white": rng.uniform(0.0005, 0.004)}
        sizes["quantised"] = rng.uniform(0.001, 0.004)
        self.noise_size = sizes[self.noise] * self.travel
        self.pressure_noise = self.force_noise = 0.0
        if self.noise != "none":
            self.pressure_noise = rng.uniform(0.0002, 0.002) * self.top
            self.force_noise = rng.uniform(0.001, 0.005)
        size = self.noise_size / self.radius if joint else self.noise_size
        ends = [self.low, self.high]
        self.truth |= {
            "pressures_bar": [self.bias + end for end in ends] if joint else ends,
            "stiffness_in_all_N_per_mm": self.stiffness,
            "travel_mm": self.travel,
            "rubber_N_per_mm": self.rubber,
            "rubber_N_per_mm3": self.rubber3,
            "filling_s": self.filling,
            "filling_rate_bar_per_s": self.pressure_rate,
            "pressure_recorded": "inside" if self.inner else "command",
            "noise": {
                "kind": self.noise,
                "size_rad" if joint else "size_mm": size,
                "pressure_bar": self.pressure_noise,
                "load_share": self.force_noise,
            },
            "sample_time_s": self.dt,
        }

    # The balance of forces.

    def pull(self, p: float, x: float) -> Slope:
        """Return what a muscle of a joint pulls; rubber that is built in stretched always pulls."""
        f, k = self.law(p, x)
        y = x - (0.0 if self.slack else 2.2 * self.centre)
        rubber, rubber3 = self.rubber, self.rubber3
        return f - rubber * y - rubber3 * y**3, k - rubber - 3 * rubber3 * y * y

    def balance(self, x: float, ps: Sequence[float], load: float) -> Slope:
        """Return all forces at x but those that oppose motion, as `physics.Drive`."""
        if self.joint:
            f, k = self._joint(x, ps, load)
        elif self.slack:
            return self._cable(x, ps)
        else:
            f, k = self.law(ps[0], x)
            linear, cubic = self.rubber + self.spring, self.rubber3 + self.spring3
            f, k = f - linear * x - cubic * x**3 - load, k - linear - 3 * cubic * x * x
        if self.wall is not None:
            at, stiff, side = self.wall
            if side * (x - at) > 0:
                return f - stiff * (x - at), k - stiff
        return f, k

    def _joint(self, x: float, ps: Sequence[float], load: float) -> Slope:
        f1, k1 = self.pull(ps[0], self.centre + self.slack + x)
        f2, k2 = self.pull(ps[1], self.centre + self.slack - x)
        if self.slack:
            f1, k1 = (0.0, 0.0) if f1 < 0 else (f1, k1)
            f2, k2 = (0.0, 0.0) if f2 < 0 else (f2, k2)
        f, k = f1 - f2, k1 + k2
        pull = 1e3 * load / self.radius
        if load and self.gravity:
            f += pull * math.cos(x / self.radius)
            k -= pull * math.sin(x / self.radius) / self.radius
        elif load:
            f += pull
        return f, k

    def _cable(self, x: float, ps: Sequence[float]) -> Slope:
        f, k = self.law(ps[0], x)
        f, k = f - self.rubber * x, k - self.rubber
        y = x - self.slack
        if y > 0:
            series = self.spring * self.cable / (self.spring + self.cable)
            f, k = f - series * y, k - series
        return f, k

    def _least_pull(self, ps: Sequence[float], x: float) -> float:
        return min(self.pull(ps[0], self.centre + x)[0], self.pull(ps[1], self.centre - x)[0])

    def _both(self, u: float) -> list[float]:
        return [self.bias + u, self.bias - u] if self.joint else [u]

    def _usual(self) -> float:
        return 0.5 * (self.heaviest + self.lightest) if self.kind == "load" else 0.0

    def _at(self, u: float) -> float:
        return physics.equilibrium(self.balance, self._both(u), self._usual())

    def _travel(self) -> float:
        return self._at(self.high) - self._at(self.low)

    # Runs.

    def pattern(self, name: str, seconds: float, faster: float = 1.0) -> Array:
        """Return a pattern of pressure, of joints half the difference [bar]."""
        rng, dt, low, high, pace = self.rng, self.dt, self.low, self.high, self.pace / faster
        if name == "nested":
            return motions.nested(rng, seconds, dt, low, high, 2 * pace)
        if name == "turning":
            return motions.turning(rng, seconds, dt, low, high, pace)
        if name == "stairs":
            return motions.stairs(rng, seconds, dt, low, high, 1.2 * pace, ramp=0.3 / faster)
        if name == "steps":
            sixth, ramp = 0.5 * ((high - low) / 3), min(0.04, 0.5 * pace)
            return motions.stairs(rng, seconds, dt, low + sixth, high - sixth, pace, ramp)
        if name == "chirp":
            share, middle = rng.uniform(0.06, 0.1) * (high - low), 0.5 * (low + high)
            ends = middle - share, middle + share
            return motions.chirp(seconds, dt, *ends, 0.2 * self.natural, 1.5 * self.natural)
        return motions.sines(rng, seconds, dt, low, high, 0.6 / pace)

    def load(self, seconds: float, how: float | None, factor: float = 1.0) -> Array | None:
        """Return the load of a run: constant, from 0 (lightest) to 1, or varying if None.

        ``factor`` scales the heaviest.
        """
        if not self.payload:
            return None
        low, high = self.lightest, self.heaviest * factor
        if how is None and self.lift_mass:  # a mass does not change within a run
            how = float(self.rng.choice([0.75, 0.9, 1.0]))
        if how is None:
            return motions.slow_levels(self.rng, seconds, self.dt, low, high, 2.5 * self.pace)
        return np.full(round(seconds / self.dt), low + (high - low) * how)

    def run(
        self,
        name: str,
        commands: Array,
        load: Array | None,
        offset: float = 0.0,
        bias: ArrayLike | None = None,
    ) -> Recording:
        """Return a recording of a motion; ``moved`` keeps x itself.

        ``offset`` is that of displacement [mm], ``bias`` the mean of a joint's pressures [bar].
        """
        rest = {} if self.joint else {"rest_length": round(self.rest, 3)}
        pressures = commands[:, None]
        if self.joint:
            middle = self.bias if bias is None else np.asarray(bias)
            pressures = np.column_stack([middle + commands, middle - commands])
        mass = float(load.mean() / GRAVITY) if self.lift_mass and load is not None else None
        x, inside = physics.simulate(self.rig, pressures, load, self.dt, mass=mass)
        shown = inside if self.inner else pressures
        shown = shown + self.pressure_noise * self._normal(shown.shape)
        out, seen = x, load
        if self.slack and self.kind == "spring" and self.variant % 2 == 0:
            out = np.maximum(0.0, x - self.slack) * self.cable / (self.spring + self.cable)
        if self.joint:
            channels = {"pressure_1": shown[:, 0], "pressure_2": shown[:, 1]}
            channels["angle"] = self._measured(out) / self.radius
            if load is not None and self.gravity:
                seen = load * np.cos(x / self.radius)
            if not self.slack:
                pairs = zip(inside[::7], x[::7], strict=True)
                least = min(self._least_pull(p, s) for p, s in pairs)
                self.truth["least_tension_N"] = min(
                    least, self.truth.get("least_tension_N", np.inf)
                )
        else:
            channels = {"pressure": shown[:, 0], "displacement": self._measured(out) + offset}
        if seen is not None:
            noise = self.force_noise * self.heaviest * self._normal(seen.shape)
            channels["torque" if self.joint else "force"] = seen + noise
        self.moved = x
        return Recording(channels, sample_time=self.dt, meta={"name": name} | rest)

    def _measured(self, x: Array) -> Array:
        if self.noise == "white":
            return x + self.noise_size * self._normal(x.shape)
        if self.noise == "quantised" and self.noise_size:
            return np.round(x / self.noise_size) * self.noise_size
        return x

    def _normal(self, shape: tuple[int, ...]) -> Array:
        own = self.rng.standard_normal(shape)
        return own if self.sensors is None else self.sensors.standard_normal(shape)

    def put_wall(self, side: int, share: float, times: float) -> None:
        """Place a wall where a free run would be beyond for a share of the time.

        ``side`` is 1 where it is above, else -1; the wall is ``times`` as stiff as all the rest.
        """
        state, xs = self.rng.bit_generator.state, []
        for name, how in (("nested", 0.0), ("turning", 1.0), ("stairs", 0.5), ("sines", 0.5)):
            self.run("free", self.pattern(name, 20.0), self.load(20.0, how))
            xs.append(self.moved)
        self.rng.bit_generator.state = state
        at = float(np.quantile(np.concatenate(xs), 1 - share if side > 0 else share))
        stiff = times * self.stiffness
        self.wall = (at, stiff, side)
        above = "above" if side > 0 else "below"
        self.truth |= {"wall_mm": at, "wall_N_per_mm": stiff, "wall_side": above}
        if self.joint:
            self.truth["wall_rad"] = at / self.radius
            self.truth["wall_N_m_per_rad"] = stiff * self.radius**2 * 1e-3
            self.truth["wall_note"] = "wall_mm is at the pulley's radius"

    def in_contact(self, xs: Iterable[Array]) -> float:
        """Return the share of motions beyond the wall."""
        assert self.wall is not None
        at, _, side = self.wall
        return float(np.mean(np.concatenate([*xs]) * side > at * side))
