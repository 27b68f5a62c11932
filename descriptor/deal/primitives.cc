// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/deal/primitives.h"

namespace pliant::deal {
namespace {

using dnnl::memory;
using Tag = memory::format_tag;

void AddScratch(const memory::desc& desc, void* scratch,
                std::unordered_map<int, memory>* arguments) {
  if (desc.get_size() > 0) {
    arguments->emplace(DNNL_ARG_SCRATCHPAD, memory(desc, CpuEngine(), scratch));
  }
}

}  // namespace

const dnnl::engine& CpuEngine() {
  static const dnnl::engine engine(dnnl::engine::kind::cpu, 0);
  return engine;
}

dnnl::primitive_attr ScratchByCaller() {
  dnnl::primitive_attr attributes;
  attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
  return attributes;
}

memory::data_type FastestType() {
  constexpr auto kBfloat16 = static_cast<unsigned>(dnnl::cpu_isa::avx512_core_bf16);
  const auto usable = static_cast<unsigned>(dnnl::get_effective_cpu_isa());
  return (usable & kBfloat16) == kBfloat16 ? memory::data_type::bf16 : memory::data_type::f32;
}

memory::desc DenseDesc(const memory::dims& dims, Tag tag, memory::data_type type) {
  return {dims, type, tag};
}

memory Reordered(std::span<const float> values, const memory::desc& from, const memory::desc& to) {
  // oneDNN takes a mutable pointer for what it only reads.
  memory source(from, CpuEngine(), const_cast<float*>(values.data()));
  memory destination(to, CpuEngine());
  dnnl::stream stream(CpuEngine());
  dnnl::reorder(source, destination).execute(stream, source, destination);
  stream.wait();
  return destination;
}

ConvPrimitive::ConvPrimitive(const ConvLayer& layer, const memory::desc& source,
                             const memory::desc& destination, const ConvOptions& options) {
  const memory::dims weight_dims = {layer.outputs, layer.inputs, layer.kernel_height,
                                    layer.kernel_width};
  const memory::desc bias_desc = DenseDesc({layer.outputs}, Tag::a);
  dnnl::post_ops after;
  if (options.add_to_destination) after.append_sum(1.0F);
  if (options.relu) onednn::AppendActivation(after, dnnl::algorithm::eltwise_relu);
  dnnl::primitive_attr attributes = ScratchByCaller();
  attributes.set_post_ops(after);
  const memory::dims strides = {layer.stride, layer.stride};
  description_ = onednn::MakeConvolution(
      CpuEngine(), source, DenseDesc(weight_dims, Tag::any, onednn::TypeOf(source)), bias_desc,
      destination, strides, {options.pad_top, options.pad_left},
      {options.pad_bottom, options.pad_right}, attributes);
  primitive_ = dnnl::convolution_forward(description_);
  weight_ = Reordered(layer.weight, DenseDesc(weight_dims, Tag::oihw), description_.weights_desc());
  bias_ = Reordered(layer.bias, bias_desc, bias_desc);
}

ConvPrimitive::Arguments ConvPrimitive::Bind(void* source, void* destination, void* scratch) const {
  Arguments arguments = {{DNNL_ARG_SRC, memory(description_.src_desc(), CpuEngine(), source)},
                         {DNNL_ARG_WEIGHTS, weight_},
                         {DNNL_ARG_BIAS, bias_},
                         {DNNL_ARG_DST, memory(description_.dst_desc(), CpuEngine(), destination)}};
  AddScratch(description_.scratchpad_desc(), scratch, &arguments);
  return arguments;
}

ProductPrimitive::ProductPrimitive(const Shape& shape, std::span<const float> weight,
                                   bool transposed, std::span<const float> bias,
                                   Activation activation)
    : shape_(shape), activation_(activation), has_bias_(!bias.empty()) {
  const memory::dims weight_dims = shape.batch > 0
                                       ? memory::dims{shape.batch, shape.inner, shape.columns}
                                       : memory::dims{shape.inner, shape.columns};
  Create(DenseDesc(weight_dims, Tag::any, shape.source));
  const Tag tag =
      shape.batch > 0 ? (transposed ? Tag::acb : Tag::abc) : (transposed ? Tag::ba : Tag::ab);
  weight_ = Reordered(weight, DenseDesc(weight_dims, tag), description_.weights_desc());
  if (has_bias_) {
    const memory::desc bias_desc = DenseDesc({1, shape.columns}, Tag::ab);
    bias_ = Reordered(bias, bias_desc, bias_desc);
  }
}

ProductPrimitive::ProductPrimitive(const ProductPrimitive& other, int rows)
    : shape_(other.shape_),
      activation_(other.activation_),
      has_bias_(other.has_bias_),
      weight_(other.weight_),
      bias_(other.bias_) {
  shape_.rows = rows;
  Create(other.description_.weights_desc());
}

void ProductPrimitive::Create(const memory::desc& weight_desc) {
  dnnl::post_ops after;
  if (activation_ == Activation::kRelu) {
    onednn::AppendActivation(after, dnnl::algorithm::eltwise_relu);
  } else if (activation_ == Activation::kTanh) {
    onednn::AppendActivation(after, dnnl::algorithm::eltwise_tanh);
  }
  dnnl::primitive_attr attributes = ScratchByCaller();
  attributes.set_post_ops(after);
  const bool batched = shape_.batch > 0;
  const Tag tag = batched ? Tag::abc : Tag::ab;
  const memory::desc source =
      DenseDesc(batched ? memory::dims{shape_.batch, shape_.rows, shape_.inner}
                        : memory::dims{shape_.rows, shape_.inner},
                tag, shape_.source);
  const memory::desc destination =
      DenseDesc(batched ? memory::dims{shape_.batch, shape_.rows, shape_.columns}
                        : memory::dims{shape_.rows, shape_.columns},
                tag, shape_.destination);
  const memory::desc bias = has_bias_ ? DenseDesc({1, shape_.columns}, Tag::ab) : memory::desc();
  description_ =
      onednn::MakeProduct(CpuEngine(), source, weight_desc, bias, destination, attributes);
  primitive_ = dnnl::matmul(description_);
}

void ProductPrimitive::Run(const dnnl::stream& stream, const void* source, void* destination,
                           void* scratch) const {
  std::unordered_map<int, memory> arguments = {
      {DNNL_ARG_SRC, memory(description_.src_desc(), CpuEngine(), const_cast<void*>(source))},
      {DNNL_ARG_WEIGHTS, weight_},
      {DNNL_ARG_DST, memory(description_.dst_desc(), CpuEngine(), destination)}};
  if (has_bias_) arguments.emplace(DNNL_ARG_BIAS, bias_);
  AddScratch(description_.scratchpad_desc(), scratch, &arguments);
  primitive_.execute(stream, arguments);
}

}  // namespace pliant::deal
