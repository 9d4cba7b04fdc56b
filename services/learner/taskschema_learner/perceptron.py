"""ReLU layers over one flat parameter vector, with their gradient written out."""

from typing import Any

import torch
from torch import Tensor

Shapes = list[tuple[int, int]]
"""(inputs, outputs) of each layer."""


def parameter_count(shapes: Shapes) -> int:
    """Return P, the number of all weights and biases."""
    return sum((inputs + 1) * outputs for inputs, outputs in shapes)


def layer_views(flat: Tensor, shapes: Shapes) -> list[tuple[Tensor, Tensor]]:
    """Return each layer's weight [O, I] and bias [O] as views of `flat` [P]."""
    sizes = [size for inputs, outputs in shapes for size in (inputs * outputs, outputs)]
    parts = torch.split(flat, sizes)
    return [
        (parts[2 * layer].view(outputs, inputs), parts[2 * layer + 1])
        for layer, (inputs, outputs) in enumerate(shapes)
    ]


class Perceptron(torch.autograd.Function):
    """A multi-layer perceptron with ReLU between its layers, as one operation of autograd.

    Minibatches are so small that the number of operations decides how long an update takes: here forward
    and backward need half of what one autograd node per operation and parameter would.
    """

    @staticmethod
    def forward(ctx: Any, flat: Tensor, inputs: Tensor, shapes: Shapes) -> Tensor:  # noqa: ANN401
        """Return outputs [B, O] of inputs [B, I], for parameters `flat` [P]; inputs get no gradient."""
        layers = layer_views(flat, shapes)
        activations = [inputs]
        for weight, bias in layers[:-1]:
            activations.append(torch.addmm(bias, activations[-1], weight.t()).relu_())
        ctx.shapes, ctx.layers, ctx.activations = shapes, layers, activations
        weight, bias = layers[-1]
        return torch.addmm(bias, activations[-1], weight.t())

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:  # noqa: ANN401
        """Return the gradient of `flat` [P].

        For a layer y = W x + b:  dW = dy' x,  db = sum dy,  dx = dy W, and 0 where ReLU cut x off.
        """
        (gradient,) = gradients
        result = gradient.new_empty(parameter_count(ctx.shapes))
        views = layer_views(result, ctx.shapes)
        for layer in reversed(range(len(views))):
            inputs = ctx.activations[layer]
            weight_gradient, bias_gradient = views[layer]
            torch.mm(gradient.t(), inputs, out=weight_gradient)
            torch.sum(gradient, 0, out=bias_gradient)
            if layer > 0:
                through = torch.mm(gradient, ctx.layers[layer][0])
                gradient = torch.ops.aten.threshold_backward(through, inputs, 0.0)
        return result, None, None
