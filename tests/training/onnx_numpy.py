# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Runs an ONNX graph node by node, for checks where there is no ONNX Runtime (Debian 12): the operators that
descriptor.training.onnx_model writes, as the operators' documentation defines them. PyTorch convolves."""

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch.nn import functional as F


def _conv(node, x, weight, bias=None):
    pads = node.get("pads", [0, 0, 0, 0])
    assert pads[:2] == pads[2:] and node.get("group", 1) == 1
    y = F.conv2d(torch.from_numpy(x), torch.from_numpy(weight), None if bias is None else torch.from_numpy(bias),
                 node.get("strides", 1), pads[:2], node.get("dilations", 1))
    return y.numpy()


def _max_pool(node, x):
    assert not node.get("ceil_mode", 0)
    return F.max_pool2d(torch.from_numpy(x), node["kernel_shape"], node["strides"], node["pads"][:2]).numpy()


def _batch_norm(node, x, scale, bias, mean, variance):
    shape = (1, -1, 1, 1)
    scale = scale / np.sqrt(variance + np.float32(node.get("epsilon", 1e-5)))
    return x * scale.reshape(shape) + (bias - mean * scale).reshape(shape)


def _slice(_, x, starts, ends, axes=None, steps=None):
    index = [slice(None)] * x.ndim
    axes = range(len(starts)) if axes is None else axes
    steps = np.ones(len(starts), int) if steps is None else steps
    for start, end, axis, step in zip(starts, ends, axes, steps):
        index[axis] = slice(int(start), int(end), int(step))
    return x[tuple(index)]


def _reshape(_, x, shape):
    return x.reshape([x.shape[i] if extent == 0 else int(extent) for i, extent in enumerate(shape)])


def _gather(node, x, index):
    return np.take(x, index, axis=node.get("axis", 0))  # raises IndexError beyond the end


def _unsqueeze(_, x, axes):
    return np.expand_dims(x, tuple(int(axis) for axis in axes))


def _reduce(function, node, x, axes=None):
    axes = node.get("axes", axes)
    return function(x, axis=tuple(int(a) for a in axes), keepdims=bool(node.get("keepdims", 1)))


def _gemm(node, a, b, c):
    assert node.get("alpha", 1.0) == node.get("beta", 1.0) == 1.0 and not node.get("transA", 0)
    return a @ (b.T if node.get("transB", 0) else b) + c


def _cast(node, x):
    return x.astype(onnx.mapping.TENSOR_TYPE_TO_NP_TYPE[node["to"]] if hasattr(onnx, "mapping")
                    else onnx.helper.tensor_dtype_to_np_dtype(node["to"]))


def _divide(_, a, b):
    if np.issubdtype(a.dtype, np.integer):
        return a // b
    return a / b


_OPERATORS = {
    "Add": lambda _, a, b: a + b,
    "BatchNormalization": _batch_norm,
    "Cast": _cast,
    "Clip": lambda _, x, low=None, high=None: np.clip(x, low, high) if low is not None or high is not None else x,
    "Concat": lambda node, *parts: np.concatenate(parts, node["axis"]),
    "Constant": lambda node: node["value"],
    "Conv": _conv,
    "Div": _divide,
    "Expand": lambda _, x, shape: x * np.ones(shape, x.dtype),
    "Flatten": lambda node, x: x.reshape(int(np.prod(x.shape[:node.get("axis", 1)])), -1),
    "Floor": lambda _, x: np.floor(x),
    "Gather": _gather,
    "Gemm": _gemm,
    "MatMul": lambda _, a, b: a @ b,
    "MaxPool": _max_pool,
    "Min": lambda _, *values: np.minimum.reduce(np.broadcast_arrays(*values)),
    "Mul": lambda _, a, b: a * b,
    "ReduceL2": lambda node, x, axes=None: np.sqrt(_reduce(np.sum, node, x * x, axes)),
    "ReduceMean": lambda node, x, axes=None: _reduce(np.mean, node, x, axes),
    "ReduceSum": lambda node, x, axes=None: _reduce(np.sum, node, x, axes),
    "Relu": lambda _, x: np.maximum(x, 0),
    "Reshape": _reshape,
    "Shape": lambda _, x: np.array(x.shape, np.int64),
    "Slice": _slice,
    "Sqrt": lambda _, x: np.sqrt(x),
    "Sub": lambda _, a, b: a - b,
    "Tanh": lambda _, x: np.tanh(x),
    "Transpose": lambda node, x: np.transpose(x, node["perm"]),
    "Unsqueeze": _unsqueeze,
}


def _attributes(node):
    values = {}
    for attribute in node.attribute:
        value = onnx.helper.get_attribute_value(attribute)
        values[attribute.name] = numpy_helper.to_array(value) if attribute.type == onnx.AttributeProto.TENSOR else value
    return values


def run(model, inputs):
    """The graph's outputs, in order, for arrays by input name."""
    values = {"": None, **{tensor.name: numpy_helper.to_array(tensor) for tensor in model.graph.initializer}, **inputs}
    for node in model.graph.node:
        if node.op_type not in _OPERATORS:
            raise NotImplementedError(f"{node.op_type} ({node.name})")
        result = _OPERATORS[node.op_type](_attributes(node), *(values[name] for name in node.input))
        values[node.output[0]] = np.asarray(result)
    return [values[output.name] for output in model.graph.output]
