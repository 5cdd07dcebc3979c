"""The compiled substeps of the monodomain equation (units/kernels/monodomain.h), in the place of `integration`."""

import ctypes
from ctypes import c_double, c_int64, c_void_p
from typing import Any

import numpy as np
from scipy.sparse.csgraph import reverse_cuthill_mckee

from .. import kernels
from ..arrays import FloatArray
from ..kernels import Kernel
from ..mesh.finite_elements import quadrature
from ..mesh.sparsity import Pattern
from .ionic.model import IonicModel
from .monodomain import Monodomain
from .progress import LARGEST_PHI, NOT_ACTIVATED, SOLVER_ITERATIONS, SOLVER_TOLERANCE, Limits, Progress, unsolved

#: As in units/kernels: rows of a chunk, most variables of a cell, and what the function returns.
_ROWS, _MOST_VARIABLES = 8, 8
_UNSOLVED, _TOO_LOW, _TOO_LARGE = 1, 2, 3


class _Pattern(ctypes.Structure):
    """`struct pattern` of conjugate_gradients.h."""

    _fields_ = (
        ("chunks", c_int64),
        ("starts", c_void_p),
        ("columns", c_void_p),
        ("diagonal", c_void_p),
    )


class _Monodomain(ctypes.Structure):
    """`struct monodomain` of monodomain.h."""

    _fields_ = (
        ("pattern", _Pattern),
        ("nodes", c_int64),
        ("elements", c_int64),
        ("corners", c_int64),
        ("integrated", c_int64),
        ("variables", c_int64),
        ("lumped", c_int64),
        ("mass", c_void_p),
        ("diffusion", c_void_p),
        ("node_rate", c_void_p),
        ("conductance", c_void_p),
        ("slots", c_void_p),
        ("cells", c_void_p),
        ("shapes", c_void_p),
        ("point_weights", c_void_p),
        ("constants", c_void_p),
        ("rates", c_void_p),
        ("reversal", c_double),
        ("tolerance", c_double),
        ("most_iterations", c_int64),
        ("activation_phi", c_double),
        ("lowest_phi", c_double),
        ("largest_phi", c_double),
    )


class _Chunks:
    """A pattern in chunks of rows, each filled up to its longest row; `place` of each entry of the CSR matrix.

    Nodes that are neighbours are numbered one after the other (reverse Cuthill–McKee), whatever the mesh's numbers: on
    meshes that are larger than the processor's caches the products would wait for memory otherwise. `order` has the
    mesh's number for each of ours, `rank` ours for each of the mesh's.
    """

    def __init__(self, pattern: Pattern) -> None:
        graph = pattern.csr(np.ones(pattern.entries, dtype=np.int8))
        self.order = reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.int64)
        self.rank = np.empty_like(self.order)
        self.rank[self.order] = np.arange(pattern.size, dtype=self.rank.dtype)
        lengths = np.diff(pattern.row_starts)
        self.count = -(-pattern.size // _ROWS)
        self.size = _ROWS * self.count
        # The rows that fill up the last chunk have a diagonal, so that it can be inverted.
        every = np.concatenate([lengths[self.order], np.ones(self.size - pattern.size, dtype=lengths.dtype)])
        self.starts = np.concatenate([[0], np.cumsum(_ROWS * every.reshape(-1, _ROWS).max(axis=1))]).astype(np.int32)
        rows = np.arange(self.size)
        first = self.starts[rows // _ROWS] + (rows % _ROWS).astype(np.int32)
        row = np.repeat(np.arange(pattern.size, dtype=np.int32), lengths)
        within = np.arange(pattern.entries, dtype=np.int32) - pattern.row_starts[row]
        self.place = first[self.rank[row]] + _ROWS * within
        self.filling = first[pattern.size :]
        self.columns = np.zeros(self.starts[-1], dtype=np.int32)
        self.columns[self.place] = self.rank[pattern.columns]
        self.columns[self.filling] = rows[pattern.size :]
        self.diagonal = np.concatenate([self.place[pattern.diagonal][self.order], self.filling]).astype(np.int32)

    def matrix(self, values: FloatArray, filling: float) -> FloatArray:
        """The entries of a CSR matrix in their places."""
        placed = np.zeros(self.starts[-1])
        placed[self.place] = values
        placed[self.filling] = filling
        return placed

    def vector(self, values: FloatArray) -> FloatArray:
        """`values`, shape (..., nodes), in our order and filled up with zeros."""
        filled = np.zeros((*values.shape[:-1], self.size))
        filled[..., : len(self.order)] = np.take(values, self.order, axis=-1)
        return filled


class CompiledIntegration:
    """The substeps of `equation` with the cells of `ionic`: by the kernel `advance`, with the model's twin `rates`."""

    def __init__(self, equation: Monodomain, ionic: IonicModel, limits: Limits, advance: Kernel, rates: Any) -> None:
        self._limits = limits
        self._function = advance
        self._chunks = chunks = _Chunks(equation.pattern)
        mesh, corners = equation.mesh, equation.mesh.dimension + 1
        # Held here: the structure has their addresses only.
        self._arrays: dict[str, Any] = {
            "mass": chunks.matrix(equation.mass_values, 1.0),
            "diffusion": chunks.matrix(equation.diffusion_values, 0.0),
            "node_rate": chunks.vector(equation.node_rate),
            "conductance": equation.opening * mesh.volumes / (corners * (corners + 1)),
            "slots": chunks.place[equation.pattern.slots],
            "cells": chunks.rank[mesh.cells].astype(np.int32),
            "shapes": np.empty(0) if equation.nodal else quadrature(mesh.dimension)[0],
            "point_weights": np.empty(0) if equation.nodal else self._weights(equation),
            "constants": np.array(ionic.constants, dtype=np.float64),
        }
        self._equation = _Monodomain(
            _Pattern(chunks.count, *map(kernels.address, (chunks.starts, chunks.columns, chunks.diagonal))),
            mesh.nodes,
            mesh.elements,
            corners,
            not equation.nodal,
            1 + len(ionic.states),
            equation.lumped,
            *map(kernels.address, self._arrays.values()),
            ctypes.cast(rates, c_void_p),
            equation.reversal,
            SOLVER_TOLERANCE,
            SOLVER_ITERATIONS,
            limits.activation_phi,
            limits.lowest_phi,
            LARGEST_PHI,
        )
        self._work = np.empty(2 * int(chunks.starts[-1]) + (4 * (1 + len(ionic.states)) + 7) * chunks.size)

    def advance(
        self, progress: Progress, first: FloatArray, last: FloatArray, time: float, substep: float, count: int
    ) -> Progress:
        """See Integration."""
        values = self._chunks.vector(progress.values)
        increments = self._chunks.vector(progress.increments)
        activation_time = progress.activation_time[self._chunks.order]
        report = np.empty(2)
        first, last = np.ascontiguousarray(first), np.ascontiguousarray(last)
        ratio = substep / progress.substep_ms if progress.substep_ms else 0.0
        numbers = np.array([time, substep, ratio, NOT_ACTIVATED])
        arrays = (numbers, first, last, values, increments, activation_time, self._work, report)
        wrong = self._function(
            count, np.array_equal(first, last), ctypes.addressof(self._equation), *map(kernels.address, arrays)
        )
        if wrong == _UNSOLVED:
            raise unsolved()
        if wrong == _TOO_LOW:
            raise self._limits.too_low(int(self._chunks.order[int(report[0])]))
        if wrong == _TOO_LARGE:
            raise self._limits.too_large(int(self._chunks.order[int(report[0])]), float(report[1]))
        values, activation_time, increments = (
            np.take(array, self._chunks.rank, axis=-1) for array in (values, activation_time, increments)
        )
        return Progress(values, activation_time, increments, substep)

    @staticmethod
    def _weights(equation: Monodomain) -> FloatArray:
        weights = np.outer(equation.mesh.volumes, quadrature(equation.mesh.dimension)[1])
        return weights.ravel() * equation.point_rate


def compiled(equation: Monodomain, ionic: IonicModel, limits: Limits) -> CompiledIntegration | None:
    """The compiled substeps; None where there are no kernels, or none for the ionic model."""
    if kernels.variant() is None or ionic.kernel is None or 1 + len(ionic.states) > _MOST_VARIABLES:
        return None
    advance = kernels.kernel("monodomain_advance", integers=2, pointers=9)
    rates = kernels.kernel(ionic.kernel, integers=2, pointers=3)
    return CompiledIntegration(equation, ionic, limits, advance, rates)
