// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Thin helpers over oneDNN: layers with their weights already in the layout the library prefers.
// Internal to deal/.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <dnnl.hpp>

#include "descriptor/deal/weights.h"

namespace pliant::deal {

const dnnl::engine& CpuEngine();

dnnl::memory::desc DenseDesc(const dnnl::memory::dims& dims, dnnl::memory::format_tag tag);

// Copies values in layout `from` into new memory of layout `to`.
dnnl::memory Reordered(std::span<const float> values, const dnnl::memory::desc& from,
                       const dnnl::memory::desc& to);

// What follows a convolution, inside the same primitive.
struct ConvOptions {
  bool relu = false;
  bool add_to_destination = false;  // residual sum: destination += result, before the ReLU
  int pad_top = 0;                  // rows; pad_left columns of zeros on the left, and so on
  int pad_bottom = 0;
  int pad_left = 0;
  int pad_right = 0;
};

// One layer for one input shape. Immutable, so it may be run by several threads at once, each with
// its own memory and scratch.
class ConvPrimitive {
 public:
  ConvPrimitive(const ConvLayer& layer, const dnnl::memory::desc& source,
                const dnnl::memory::desc& destination, const ConvOptions& options);

  dnnl::memory::desc source_desc() const { return description_.src_desc(); }
  dnnl::memory::desc destination_desc() const { return description_.dst_desc(); }
  std::size_t scratch_bytes() const { return description_.scratchpad_desc().get_size(); }

  void Run(const dnnl::stream& stream, const dnnl::memory& source, const dnnl::memory& destination,
           void* scratch) const;

 private:
  dnnl::convolution_forward::primitive_desc description_;
  dnnl::convolution_forward primitive_;
  dnnl::memory weight_;
  dnnl::memory bias_;
};

enum class Activation { kNone, kRelu, kTanh };

// destination (M x N) = activation(source (M x K) * weight (K x N) + bias), row-major, for a fixed
// M; with `batch` > 0, that many products of separate matrices, one after another in memory.
class ProductPrimitive {
 public:
  struct Shape {
    int batch = 0;
    int rows = 0;     // M
    int inner = 0;    // K
    int columns = 0;  // N
  };

  // `weight` is K x N row-major, or N x K when `transposed`; `bias` N values or empty.
  ProductPrimitive(const Shape& shape, std::span<const float> weight, bool transposed,
                   std::span<const float> bias, Activation activation);
  // The same weights for another number of rows; shares the weight memory.
  ProductPrimitive(const ProductPrimitive& other, int rows);

  std::size_t scratch_bytes() const { return description_.scratchpad_desc().get_size(); }
  const Shape& shape() const { return shape_; }

  void Run(const dnnl::stream& stream, const float* source, float* destination,
           void* scratch) const;

 private:
  void Create(const dnnl::memory::desc& weight_desc);

  Shape shape_;
  Activation activation_;
  bool has_bias_;
  dnnl::matmul::primitive_desc description_;
  dnnl::matmul primitive_;
  dnnl::memory weight_;
  dnnl::memory bias_;
};

// 64-byte aligned floats, zero at first.
class AlignedFloats {
 public:
  AlignedFloats() = default;
  explicit AlignedFloats(std::size_t count);

  float* data() const { return data_.get(); }
  std::size_t size() const { return count_; }

 private:
  struct Free {
    void operator()(float* data) const noexcept;
  };
  std::unique_ptr<float, Free> data_;
  std::size_t count_ = 0;
};

}  // namespace pliant::deal
