// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Thin helpers over oneDNN: layers with their weights already in the layout the library prefers,
// and the resources of a running call (thread count, scratch memory). Internal to deal/.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <deque>
#include <functional>
#include <iterator>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include <dnnl.hpp>
#include <dnnl_version.h>
#include <omp.h>

#include "descriptor/deal/weights.h"

namespace pliant::deal {

// The one place that knows how oneDNN 2 (Debian 12) and oneDNN 3 (Debian 13) differ: version 3 has
// no operation descriptors, and its element-wise post-operations no scale. Internal to deal/.
namespace onednn {

using Desc = dnnl::memory::desc;
using Dims = dnnl::memory::dims;

inline dnnl::memory::data_type TypeOf(const Desc& desc) {
#if DNNL_VERSION_MAJOR >= 3
  return desc.get_data_type();
#else
  return desc.data_type();
#endif
}

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

}  // namespace onednn

const dnnl::engine& CpuEngine();

// The caller gives the scratch memory of each run.
dnnl::primitive_attr ScratchByCaller();

// In what type the networks' maps and weights are fastest: bf16 where the processor has dot
// products of it (AVX512_BF16, AMX), else f32.
dnnl::memory::data_type FastestType();

dnnl::memory::desc DenseDesc(const dnnl::memory::dims& dims, dnnl::memory::format_tag tag,
                             dnnl::memory::data_type type = dnnl::memory::data_type::f32);

// Copies values in layout `from` into new memory of layout `to`.
dnnl::memory Reordered(std::span<const float> values, const dnnl::memory::desc& from,
                       const dnnl::memory::desc& to);

// Operations after a convolution, inside the same primitive.
struct ConvOptions {
  bool relu = false;
  bool add_to_destination = false;  // residual sum: destination += result, before the ReLU
  int pad_top = 0;                  // rows; pad_left columns of zeros on the left, and so on
  int pad_bottom = 0;
  int pad_left = 0;
  int pad_right = 0;
};

// One layer for one input shape, with weights of the source's type. Immutable, so it may be run by
// several threads at once, each with its own memory and scratch.
class ConvPrimitive {
 public:
  ConvPrimitive(const ConvLayer& layer, const dnnl::memory::desc& source,
                const dnnl::memory::desc& destination, const ConvOptions& options);

  dnnl::memory::desc destination_desc() const { return description_.dst_desc(); }
  std::size_t scratch_bytes() const { return description_.scratchpad_desc().get_size(); }

  // What to run it on. Making these costs as much as a small layer.
  using Arguments = std::unordered_map<int, dnnl::memory>;
  Arguments Bind(void* source, void* destination, void* scratch) const;

  void Run(const dnnl::stream& stream, const Arguments& arguments) const {
    primitive_.execute(stream, arguments);
  }

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
    // Of source and weight, and of the destination.
    dnnl::memory::data_type source = dnnl::memory::data_type::f32;
    dnnl::memory::data_type destination = dnnl::memory::data_type::f32;
  };

  // `weight` is K x N row-major, or N x K when `transposed`; `bias` N values or empty.
  ProductPrimitive(const Shape& shape, std::span<const float> weight, bool transposed,
                   std::span<const float> bias, Activation activation);
  // The same weights for another number of rows; shares the weight memory.
  ProductPrimitive(const ProductPrimitive& other, int rows);

  std::size_t scratch_bytes() const { return description_.scratchpad_desc().get_size(); }
  const Shape& shape() const { return shape_; }

  void Run(const dnnl::stream& stream, const void* source, void* destination, void* scratch) const;

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

// 64-byte aligned values, zero at first.
template <typename Value>
class AlignedArray {
 public:
  AlignedArray() = default;
  explicit AlignedArray(std::size_t count)
      : data_(static_cast<Value*>(::operator new(count * sizeof(Value), kAlignment))),
        count_(count) {
    std::memset(data_.get(), 0, count * sizeof(Value));
  }

  Value* data() const { return data_.get(); }
  std::size_t size() const { return count_; }

 private:
  static constexpr std::align_val_t kAlignment{64};
  struct Free {
    void operator()(Value* data) const noexcept { ::operator delete(data, kAlignment); }
  };
  std::unique_ptr<Value, Free> data_;
  std::size_t count_ = 0;
};
using AlignedFloats = AlignedArray<float>;

// Sets how many threads oneDNN's primitives use when they are created or run by this thread.
class ScopedPrimitiveThreads {
 public:
  explicit ScopedPrimitiveThreads(int threads) : before_(omp_get_max_threads()) {
    omp_set_num_threads(threads);
  }
  ~ScopedPrimitiveThreads() { omp_set_num_threads(before_); }
  ScopedPrimitiveThreads(const ScopedPrimitiveThreads&) = delete;
  ScopedPrimitiveThreads& operator=(const ScopedPrimitiveThreads&) = delete;

 private:
  int before_;
};

// Reusable objects that are expensive to create and used by one call at a time (scratch memory).
// Thread-safe.
template <typename T>
class Pool {
 public:
  using Cost = std::function<std::size_t(const T&)>;

  // Those used last are kept for later, as long as their costs add up to `most` or less.
  explicit Pool(
      std::size_t most, Cost cost = [](const T&) { return std::size_t{1}; })
      : most_(most), cost_(std::move(cost)) {}

  class Lease {
   public:
    Lease(Pool& pool, std::unique_ptr<T> object) : pool_(pool), object_(std::move(object)) {}
    ~Lease() { pool_.Return(std::move(object_)); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    T& operator*() const { return *object_; }
    T* operator->() const { return object_.get(); }

   private:
    Pool& pool_;
    std::unique_ptr<T> object_;
  };

  // An idle object that `fits`, else what `make` returns.
  template <typename Fits, typename Make>
  Lease Take(const Fits& fits, const Make& make) {
    {
      const std::lock_guard lock(mutex_);
      const auto found = std::find_if(idle_.rbegin(), idle_.rend(),
                                      [&](const auto& object) { return fits(*object); });
      if (found != idle_.rend()) {
        std::unique_ptr<T> object = std::move(*found);
        idle_.erase(std::next(found).base());
        return Lease(*this, std::move(object));
      }
    }
    return Lease(*this, make());
  }

 private:
  void Return(std::unique_ptr<T> object) noexcept {
    if (cost_(*object) > most_) return;
    std::vector<std::unique_ptr<T>> dropped;  // freed outside the lock
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(object));
    std::size_t sum = 0;
    for (const auto& idle : idle_) sum += cost_(*idle);
    for (; sum > most_; idle_.pop_front()) {
      sum -= cost_(*idle_.front());
      dropped.push_back(std::move(idle_.front()));
    }
  }

  const std::size_t most_;
  const Cost cost_;
  std::mutex mutex_;
  std::deque<std::unique_ptr<T>> idle_;  // most recently used last; guarded by mutex_
};

}  // namespace pliant::deal
