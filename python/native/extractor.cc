// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/descriptor.h"
#include "python/native/bindings.h"

namespace pliant::python {
namespace {

FeatureExtractor MakeExtractor(const std::string& descriptor, const std::string& model,
                               int max_keypoints, int max_side, int enlarge_below) {
  const py::gil_scoped_release release;
  ExtractionOptions options;
  options.keypoints.max_keypoints = max_keypoints;
  options.decode.max_side_px = max_side;
  options.enlarge_below = enlarge_below;
  return {MakeDescriptor(descriptor, {model}), options};
}

py::tuple DescribeBytes(const FeatureExtractor& extractor, const py::bytes& data, int threads) {
  const Bytes bytes = ViewOf(data);
  return FromFeatures(WithoutGil([&] { return extractor.Extract(bytes, threads); }));
}

py::tuple DescribeArray(const FeatureExtractor& extractor, const ByteArray& pixels, int threads) {
  const Image image = ToImage(pixels);
  return FromFeatures(WithoutGil([&] { return extractor.ExtractFrom(image, threads); }));
}

py::bytes EncodeArray(const ByteArray& pixels) {
  const Image image = ToImage(pixels);
  return ToBytes(WithoutGil([&] { return EncodePng(image); }));
}

// H x W x 3, upright, in the image's own size.
py::array Decode(const py::bytes& data) {
  const Bytes bytes = ViewOf(data);
  return FromImage(WithoutGil([&] {
    DecodeOptions options;
    options.colour = true;
    options.max_side_px = 0;
    return DecodeImage(bytes, options).image;
  }));
}

}  // namespace

void BindExtractor(py::module_& module) {
  module.def("descriptor_names", &DescriptorNames);
  module.def("encode_png", &EncodeArray, py::arg().noconvert());
  module.def("decode", &Decode);
  py::class_<FeatureExtractor>(module, "Extractor")
      .def(py::init(&MakeExtractor))
      .def("describe_bytes", &DescribeBytes)
      .def("describe_array", &DescribeArray, py::arg().noconvert(), py::arg())
      .def_property_readonly("descriptor",
                             [](const FeatureExtractor& e) { return e.descriptor().info().name; })
      .def_property_readonly(
          "model_id", [](const FeatureExtractor& e) { return e.descriptor().info().model_id; })
      .def_property_readonly("dim",
                             [](const FeatureExtractor& e) { return e.descriptor().info().dim; });
}

}  // namespace pliant::python
