// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The one place that knows how oneDNN 2 (Debian 12) and oneDNN 3 (Debian 13) differ: version 3 has
// no operation descriptors, and its element-wise post-operations no scale. Internal to deal/.
#pragma once

#include <dnnl.hpp>
#include <dnnl_version.h>

namespace pliant::deal::onednn {

using Desc = dnnl::memory::desc;
using Dims = dnnl::memory::dims;

inline void AppendActivation(dnnl::post_ops& after, dnnl::algorithm activation) {
#if DNNL_VERSION_MAJOR >= 3
  after.append_eltwise(activation, 0.0F, 0.0F);
#else
  after.append_eltwise(1.0F, activation, 0.0F, 0.0F);
#endif
}

inline dnnl::convolution_forward::primitive_desc MakeConvolution(
    const dnnl::engine& engine, const Desc& source, const Desc& weight, const Desc& bias,
    const Desc& destination, const Dims& strides, const Dims& pad_before, const Dims& pad_after,
    const dnnl::primitive_attr& attributes) {
  constexpr auto kKind = dnnl::prop_kind::forward_inference;
  constexpr auto kAlgorithm = dnnl::algorithm::convolution_direct;
#if DNNL_VERSION_MAJOR >= 3
  return {engine,      kKind,   kAlgorithm, source,    weight,    bias,
          destination, strides, pad_before, pad_after, attributes};
#else
  return {{kKind, kAlgorithm, source, weight, bias, destination, strides, pad_before, pad_after},
          attributes,
          engine};
#endif
}

inline dnnl::pooling_forward::primitive_desc MakeMaxPooling(
    const dnnl::engine& engine, const Desc& source, const Desc& destination, const Dims& strides,
    const Dims& kernel, const Dims& pad_before, const Dims& pad_after,
    const dnnl::primitive_attr& attributes) {
  constexpr auto kKind = dnnl::prop_kind::forward_inference;
  constexpr auto kAlgorithm = dnnl::algorithm::pooling_max;
#if DNNL_VERSION_MAJOR >= 3
  const Dims dense(kernel.size(), 0);  // no dilation
  return {engine, kKind, kAlgorithm, source,    destination, strides,
          kernel, dense, pad_before, pad_after, attributes};
#else
  return {{kKind, kAlgorithm, source, destination, strides, kernel, pad_before, pad_after},
          attributes,
          engine};
#endif
}

// `bias` may be a zero descriptor: none.
inline dnnl::matmul::primitive_desc MakeProduct(const dnnl::engine& engine, const Desc& source,
                                                const Desc& weight, const Desc& bias,
                                                const Desc& destination,
                                                const dnnl::primitive_attr& attributes) {
  const bool has_bias = !bias.is_zero();
#if DNNL_VERSION_MAJOR >= 3
  if (!has_bias) return {engine, source, weight, destination, attributes};
  return {engine, source, weight, bias, destination, attributes};
#else
  using Operation = dnnl::matmul::desc;
  return {has_bias ? Operation(source, weight, bias, destination)
                   : Operation(source, weight, destination),
          attributes, engine};
#endif
}

}  // namespace pliant::deal::onednn
