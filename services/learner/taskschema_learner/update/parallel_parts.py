"""A function of a parameter vector over the parts of a batch, several parts at a time on threads."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import torch
from torch import Tensor

Function = Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]
"""(parameters [P], part of the inputs [b, ...]) -> two results [b, ...]."""


class ParallelParts:
    """Runs a differentiable function part by part; results do not depend on the number of threads.

    Parts are always the same, and their gradients are added in their order. Each is computed by one thread.

    Args:
        function: of parameters and inputs; it must treat every row by itself.
        size: rows of a part. Small parts stay in the processor's cache.
        threads: parts computed at the same time; None: as many as there are cores.

    """

    def __init__(self, function: Function, size: int, threads: int | None = None) -> None:
        self._function = function
        self._size = size
        self._threads = threads or len(os.sched_getaffinity(0))
        self._pool: ThreadPoolExecutor | None = None

    def __call__(self, parameters: Tensor, inputs: Tensor) -> tuple[Tensor, Tensor]:
        """Return both results for all inputs [B, ...]; they carry gradients to the parameters."""
        results: tuple[Tensor, Tensor] = _Parts.apply(  # type: ignore[no-untyped-call]
            parameters, inputs, self, torch.is_grad_enabled()
        )
        return results

    def split(self, values: Tensor) -> tuple[Tensor, ...]:
        """Return the parts of values [B, ...]."""
        return torch.split(values, self._size)

    def part(self, parameters: Tensor, inputs: Tensor, graded: bool) -> tuple[Tensor, Tensor]:
        """Return the results of one part, with the graph behind them if `graded`."""
        with torch.set_grad_enabled(graded):  # of the thread that runs this
            return self._function(parameters, inputs)

    def map(self, task: Callable[..., Any], *series: Any) -> list[Any]:  # noqa: ANN401
        """Return a task's results over series of equal length, in their order."""
        if self._threads == 1 or len(series[0]) == 1:
            return [task(*items) for items in zip(*series, strict=True)]
        if self._pool is None:
            # Each thread is one of ours: torch's own would change bits with their number.
            self._pool = ThreadPoolExecutor(self._threads, "parts", torch.set_num_threads, (1,))
        return list(self._pool.map(task, *series))


class _Parts(torch.autograd.Function):
    """The parts' own graphs, kept until their gradients are asked for."""

    @staticmethod
    def forward(  # noqa: D102
        ctx: Any,  # noqa: ANN401
        parameters: Tensor,
        inputs: Tensor,
        parts: ParallelParts,
        graded: bool,
    ) -> tuple[Tensor, Tensor]:
        pieces = parts.split(inputs)
        leaves = [parameters.detach().requires_grad_(graded) for _ in pieces]
        results = parts.map(parts.part, leaves, pieces, [graded] * len(pieces))
        ctx.parts, ctx.leaves, ctx.results = parts, leaves, results
        first, second = (torch.cat([item.detach() for item in items]) for items in zip(*results, strict=True))
        return first, second

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None, None]:  # noqa: ANN401, D102
        first, second = (ctx.parts.split(gradient.contiguous()) for gradient in gradients)

        def gradient_of(leaf: Tensor, results: tuple[Tensor, Tensor], *of_results: Tensor) -> Tensor:
            return torch.autograd.grad(results, leaf, of_results)[0]

        found = ctx.parts.map(gradient_of, ctx.leaves, ctx.results, first, second)
        return torch.stack(found).sum(dim=0), None, None, None
