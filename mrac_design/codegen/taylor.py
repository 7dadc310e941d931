"""Taylor series of straight-line programs: automatic differentiation in time, written out.

Every value becomes its normalised coefficients w_k = w⁽ᵏ⁾ hᵏ / k!, k = 0, 1, ..., by the rules for
power series (Moore 1966; Jorba and Zou 2005). What does not move has one coefficient only, so a
product with a parameter costs one multiplication per order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

from mrac_design.codegen.straight_line import CONSTANT, INPUT, Builder, StraightLine
from mrac_design.errors import CodeGenerationError

_PIECEWISE_CONSTANT = (
    ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT, ca.OP_SIGN,
    ca.OP_FLOOR, ca.OP_CEIL,
)  # fmt: skip


class SeriesEvaluator:
    """Coefficients of every value of a program, one order after the other.

    `inputs` holds a list of known coefficients for every entry of every input. A moving entry's
    list may grow between two calls of `advance`: so a solution feeds on itself.
    """

    def __init__(
        self,
        builder: Builder,
        program: StraightLine,
        inputs: Sequence[Sequence[list[int]]],
        *,
        moving: Sequence[bool],
    ) -> None:
        self._builder = builder
        self._program = program
        self._series: list[list[int]] = [[] for _ in program.nodes]
        self._moves: list[bool] = []
        self._order = 0
        self._pairs: dict[int, tuple[list[int], list[int]]] = {}
        self._squares: dict[int, list[int]] = {}
        self._zero = builder.constant(0.0)
        for i, (operation, arguments, _) in enumerate(program.nodes):
            if operation == INPUT:
                self._series[i] = inputs[arguments[0]][arguments[1]]
                self._moves.append(moving[arguments[0]])
            else:
                self._moves.append(
                    operation not in _PIECEWISE_CONSTANT and any(self._moves[j] for j in arguments)
                )

    def advance(self) -> dict[str, list[int]]:
        """The next coefficient of every entry of every output."""
        k = self._order
        for i, (operation, arguments, value) in enumerate(self._program.nodes):
            if operation == INPUT:
                continue
            if operation == CONSTANT:
                if k == 0:
                    self._series[i].append(self._builder.constant(value))
            elif k == 0:
                first = (self._series[j][0] for j in arguments)
                self._series[i].append(self._first(operation, i, tuple(first)))
            elif self._moves[i]:
                self._series[i].append(self._next(operation, i, arguments, k))
        self._order += 1
        return {
            name: [self._coefficient(i, k) for i in entries]
            for name, entries in self._program.outputs
        }

    def _coefficient(self, i: int, k: int) -> int:
        """Coefficient k of value i; zero beyond what is known of it."""
        return self._series[i][k] if k < len(self._series[i]) else self._zero

    def _first(self, operation: int, i: int, values: tuple[int, ...]) -> int:
        build = self._builder
        if operation == ca.OP_DIV and self._moves[i]:
            return build.multiply(values[0], self._reciprocal(values[1]))
        return build.apply(operation, *values)

    def _next(self, operation: int, i: int, arguments: tuple[int, ...], k: int) -> int:
        build = self._builder
        if operation in (ca.OP_ADD, ca.OP_SUB):
            return build.apply(operation, *(self._coefficient(j, k) for j in arguments))
        if operation == ca.OP_NEG:
            return build.apply(operation, self._coefficient(arguments[0], k))
        rule = _RULES.get(operation)
        if rule is None:
            raise CodeGenerationError(
                f"no Taylor series for CasADi's operation {operation}: choose a Runge–Kutta method"
            )
        return rule(self, i, arguments, k)

    def _reciprocal(self, value: int) -> int:
        return self._builder.divide(self._builder.constant(1.0), value)

    def _scaled(self, factor: float, value: int) -> int:
        return self._builder.multiply(self._builder.constant(factor), value)

    def _convolution(self, a: list[int], b: list[int], low: int, high: int, k: int) -> int:
        """Σ a_m b_(k−m) for m = low … high."""
        build = self._builder
        return build.total(
            [
                build.multiply(a[m], b[k - m])
                for m in range(low, high + 1)
                if m < len(a) and k - m < len(b)
            ]
        )

    def _square_sum(self, a: list[int], low: int, k: int) -> int:
        """Σ a_m a_(k−m) for m = low … k − low, each pair once."""
        build = self._builder
        half = self._convolution(a, a, low, (k - 1) // 2, k)
        twice = build.add(half, half)
        if k % 2 == 0 and low <= k // 2 < len(a):
            return build.add(twice, build.multiply(a[k // 2], a[k // 2]))
        return twice

    def _slopes(self, j: int) -> list[int]:
        """m a_m of value j for all known m."""
        return [self._scaled(float(m), a) for m, a in enumerate(self._series[j])]

    def _product(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        left, right = arguments
        if left == right:
            return self._square_sum(self._series[left], 0, k)
        if not self._moves[left]:
            left, right = right, left
        if not self._moves[right]:
            return self._builder.multiply(self._coefficient(left, k), self._series[right][0])
        return self._convolution(self._series[left], self._series[right], 0, k, k)

    def _quotient(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        top, bottom = arguments
        rest = self._coefficient(top, k)
        if self._moves[bottom]:
            known = self._convolution(self._series[bottom], self._series[i], 1, k, k)
            rest = self._builder.subtract(rest, known)
        return self._builder.multiply(rest, self._reciprocal(self._series[bottom][0]))

    def _root(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        own = self._series[i]
        rest = self._builder.subtract(
            self._coefficient(arguments[0], k), self._square_sum(own, 1, k)
        )
        return self._builder.multiply(rest, self._reciprocal(self._builder.add(own[0], own[0])))

    def _circular(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        angle = arguments[0]
        build = self._builder
        if angle not in self._pairs:
            first = self._series[angle][0]
            self._pairs[angle] = (
                [build.apply(ca.OP_SIN, first)],
                [build.apply(ca.OP_COS, first)],
            )
        sine, cosine = self._pairs[angle]
        if len(sine) == k:
            slopes = self._slopes(angle)
            into_sine = self._convolution(slopes, cosine, 1, k, k)
            into_cosine = self._convolution(slopes, sine, 1, k, k)
            sine.append(self._scaled(1 / k, into_sine))
            cosine.append(self._scaled(-1 / k, into_cosine))
        return (sine if self._program.nodes[i].operation == ca.OP_SIN else cosine)[k]

    def _exponential(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        into = self._convolution(self._slopes(arguments[0]), self._series[i], 1, k, k)
        return self._scaled(1 / k, into)

    def _logarithm(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        argument = self._series[arguments[0]]
        known = self._convolution(self._slopes(i), argument, 1, k - 1, k)
        rest = self._builder.subtract(
            self._coefficient(arguments[0], k), self._scaled(1 / k, known)
        )
        return self._builder.multiply(rest, self._reciprocal(argument[0]))

    def _tangent(self, sign: float) -> Callable[[int, tuple[int, ...], int], int]:
        """y' = (1 ± y²) x', for tan and tanh."""

        def rule(i: int, arguments: tuple[int, ...], k: int) -> int:
            build = self._builder
            slope = self._squares.setdefault(i, [])
            for m in range(len(slope), k):
                term = self._scaled(sign, self._square_sum(self._series[i], 0, m))
                slope.append(build.add(build.constant(1.0), term) if m == 0 else term)
            into = self._convolution(self._slopes(arguments[0]), slope, 1, k, k)
            return self._scaled(1 / k, into)

        return rule

    def _arctangent(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        build = self._builder
        argument = self._series[arguments[0]]
        scale = self._squares.setdefault(i, [])
        for m in range(len(scale), k):
            term = self._square_sum(argument, 0, m)
            scale.append(build.add(build.constant(1.0), term) if m == 0 else term)
        known = self._convolution(self._slopes(i), scale, 1, k - 1, k)
        rest = build.subtract(self._coefficient(arguments[0], k), self._scaled(1 / k, known))
        return build.multiply(rest, self._reciprocal(scale[0]))

    def _power(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        base, exponent = arguments
        if self._moves[exponent]:
            raise CodeGenerationError(
                "no Taylor series for a power with a moving exponent: choose a Runge–Kutta method"
            )
        build = self._builder
        terms = []
        for m in range(1, k + 1):
            weight = build.subtract(
                self._scaled(m / k, self._series[exponent][0]), build.constant((k - m) / k)
            )
            product = build.multiply(self._coefficient(base, m), self._series[i][k - m])
            terms.append(build.multiply(weight, product))
        return build.multiply(build.total(terms), self._reciprocal(self._series[base][0]))

    def _choice(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        """min and max follow the argument that is chosen at the beginning of the step."""
        build = self._builder
        a, b = (self._series[j][0] for j in arguments)
        if self._program.nodes[i].operation == ca.OP_FMAX:
            a, b = b, a
        first = build.apply(ca.OP_LT, a, b)
        chosen = (first, build.apply(ca.OP_NOT, first))
        return build.total(
            [
                build.apply(ca.OP_IF_ELSE_ZERO, condition, self._coefficient(j, k))
                for condition, j in zip(chosen, arguments, strict=True)
                if self._coefficient(j, k) != self._zero
            ]
        )

    def _magnitude(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        sign = self._builder.apply(ca.OP_SIGN, self._series[arguments[0]][0])
        return self._builder.multiply(sign, self._coefficient(arguments[0], k))

    def _condition(self, i: int, arguments: tuple[int, ...], k: int) -> int:
        condition, value = arguments
        return self._builder.apply(
            ca.OP_IF_ELSE_ZERO, self._series[condition][0], self._coefficient(value, k)
        )


_Rule = Callable[[SeriesEvaluator, int, tuple[int, ...], int], int]
_RULES: dict[int, _Rule] = {
    ca.OP_MUL: SeriesEvaluator._product,
    ca.OP_DIV: SeriesEvaluator._quotient,
    ca.OP_SQRT: SeriesEvaluator._root,
    ca.OP_SIN: SeriesEvaluator._circular,
    ca.OP_COS: SeriesEvaluator._circular,
    ca.OP_EXP: SeriesEvaluator._exponential,
    ca.OP_LOG: SeriesEvaluator._logarithm,
    ca.OP_TAN: lambda s, i, arguments, k: s._tangent(1.0)(i, arguments, k),
    ca.OP_TANH: lambda s, i, arguments, k: s._tangent(-1.0)(i, arguments, k),
    ca.OP_ATAN: SeriesEvaluator._arctangent,
    ca.OP_POW: SeriesEvaluator._power,
    ca.OP_FMIN: SeriesEvaluator._choice,
    ca.OP_FMAX: SeriesEvaluator._choice,
    ca.OP_FABS: SeriesEvaluator._magnitude,
    ca.OP_IF_ELSE_ZERO: SeriesEvaluator._condition,
}
