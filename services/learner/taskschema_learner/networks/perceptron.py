"""ReLU layers over one flat parameter vector, with their gradient written out."""

import torch
from torch import Tensor

Shapes = list[tuple[int, int]]
"""(inputs, outputs) of each layer."""
Layers = list[tuple[Tensor, Tensor]]
"""Each layer's weight [O, I] and bias [O]."""


def parameter_count(shapes: Shapes) -> int:
    """Return P, the number of all weights and biases."""
    return sum((inputs + 1) * outputs for inputs, outputs in shapes)


def layer_views(flat: Tensor, shapes: Shapes) -> Layers:
    """Return each layer's weight and bias as views of `flat` [P]."""
    sizes = [size for inputs, outputs in shapes for size in (inputs * outputs, outputs)]
    parts = torch.split(flat, sizes)
    return [
        (parts[2 * layer].view(outputs, inputs), parts[2 * layer + 1])
        for layer, (inputs, outputs) in enumerate(shapes)
    ]


class Perceptron:
    """A multi-layer perceptron with ReLU between its layers.

    Minibatches are so small that the number of operations decides how long an update takes: autograd, with a
    node per operation and parameter, would need twice as long.
    """

    def __init__(self, flat: Tensor, shapes: Shapes) -> None:
        """Compute with the parameters `flat` [P], whatever they are at each call."""
        self._layers = layer_views(flat.detach(), shapes)
        self._gradient = torch.zeros_like(flat, requires_grad=False)
        self._gradient_layers = layer_views(self._gradient, shapes)

    def forward(self, inputs: Tensor) -> list[Tensor]:
        """Return what each layer gets, `inputs` [B, I] first, and last the outputs [B, O]."""
        activations = [inputs]
        for weight, bias in self._layers[:-1]:
            activations.append(torch.addmm(bias, activations[-1], weight.t()).relu_())
        weight, bias = self._layers[-1]
        return [*activations, torch.addmm(bias, activations[-1], weight.t())]

    def gradient(self, activations: list[Tensor], by_outputs: Tensor) -> Tensor:
        """Return the gradient [P] by the parameters, valid until the next call.

        For a layer y = W x + b:  dW = dy' x,  db = sum dy,  dx = dy W, and 0 where ReLU cut x off.

        Args:
            activations: what `forward` returned, the outputs not needed.
            by_outputs: [B, O] the gradient by the outputs.

        """
        through = by_outputs
        for layer in reversed(range(len(self._layers))):
            inputs = activations[layer]
            weight_gradient, bias_gradient = self._gradient_layers[layer]
            torch.mm(through.t(), inputs, out=weight_gradient)
            torch.sum(through, 0, out=bias_gradient)
            if layer > 0:
                by_inputs = torch.mm(through, self._layers[layer][0])
                through = torch.ops.aten.threshold_backward(by_inputs, inputs, 0.0)
        return self._gradient
