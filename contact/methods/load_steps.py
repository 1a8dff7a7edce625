"""The road in load steps of a static problem: its loads grow with time from 0 to 1."""

from __future__ import annotations

from dataclasses import replace

from contact.methods.frozen_friction import frozen_friction
from contact.methods.loop import NewtonLoop
from contact.methods.report import Outcome
from contact.methods.step import Iterate
from contact.problem.kkt import evaluate

#: Part of the load in the first of the load steps, and the least one that is tried.
FIRST_STEP, LEAST_STEP = 0.25, 1e-2


def load_steps(loop: NewtonLoop) -> tuple[Iterate, Outcome]:
    """Apply loads and prescribed displacements in steps, halved where they are too large."""
    search, problem = loop.search, loop.search.problem
    body, step, reached = problem.equilibrium, FIRST_STEP, 0.0
    iterate = Iterate(problem.start(0.0))
    while reached < 1.0 and step > LEAST_STEP and search.left > 0:
        load = min(1.0, reached + step)
        state = iterate.state
        loaded = replace(state, x=body.prescribe(state.x, load), time=load)
        tried, outcome = loop.run(replace(iterate, state=loaded), f"load {load:.3g}")
        if not outcome.converged and problem.interface.friction.acts:
            tried, outcome = frozen_friction(loop, tried)
        if outcome.converged:
            iterate, reached = tried, load
        else:
            step /= 2
    state, time = iterate.state, problem.time
    whole = replace(state, x=body.prescribe(state.x, time), time=time)
    iterate = replace(iterate, state=whole)
    residuals = evaluate(problem, iterate.state)
    search.see(iterate, residuals)
    ended = "" if reached == 1.0 else f"load steps ended at {reached:.3g} of the load"
    return iterate, Outcome(residuals, search.options.allowed, ended)
