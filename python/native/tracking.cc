// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <memory>
#include <optional>

#include "index/json/result_json.h"
#include "index/tracking/frame_source.h"
#include "index/tracking/tracker.h"
#include "python/native/bindings.h"

namespace pliant::python {
namespace {

std::unique_ptr<Tracker> MakeTracker(const FeatureExtractor& extractor, const ByteArray& reference,
                                     const std::optional<std::array<int, 4>>& region,
                                     const std::optional<ByteArray>& mask, int iterations,
                                     int min_inliers, double max_ratio, double tolerance,
                                     double regularization, int threads) {
  TrackerOptions options;
  options.extraction = extractor.options();
  options.threads = threads;
  options.locate.min_inliers = min_inliers;
  options.locate.verification.max_ratio = static_cast<float>(max_ratio);
  options.locate.verification.tolerance = tolerance;
  options.locate.verification.ransac.iterations = iterations;
  options.locate.verification.ransac.regularization = regularization;
  if (region) {
    options.region = PixelBox{(*region)[0], (*region)[1], (*region)[2], (*region)[3]};
  }
  if (mask) options.mask = ToImage(*mask);
  const Image image = ToImage(reference);
  // Shared with the extractor, which Python keeps alive as long as the tracker.
  const std::shared_ptr<const Descriptor> descriptor(std::shared_ptr<void>(),
                                                     &extractor.descriptor());
  const py::gil_scoped_release release;
  return std::make_unique<Tracker>(descriptor, image, options);
}

// (the JSON text of the location, the inliers as K x 2 of template and frame, the warp or None)
py::tuple Find(const Tracker& tracker, const ByteArray& pixels) {
  const Image frame = ToImage(pixels);
  const auto [features, location] = WithoutGil([&] {
    Features described = tracker.Describe(frame);
    Location found = tracker.Find(described);
    return std::pair(std::move(described), std::move(found));
  });
  std::vector<Vec2> on_template;
  std::vector<Vec2> in_frame;
  for (const MatchedPair& pair : location.inliers) {
    const Keypoint& t = tracker.features().keypoints[pair.reference];
    const Keypoint& f = features.keypoints[pair.query];
    on_template.push_back({t.x, t.y});
    in_frame.push_back({f.x, f.y});
  }
  return py::make_tuple(ToText(LocationJson(location)), FromPoints(on_template),
                        FromPoints(in_frame), location.warp);
}

// The next (number, seconds or None, file name, image H x W x 3 RGB), or None at the end.
py::object NextFrame(FrameSource& source) {
  const std::optional<Frame> frame = WithoutGil([&] { return source.Next(); });
  if (!frame) return py::none();
  const auto name = py::reinterpret_steal<py::object>(PyUnicode_DecodeFSDefaultAndSize(
      frame->file.data(), static_cast<Py_ssize_t>(frame->file.size())));
  if (!name) throw py::error_already_set();
  return py::make_tuple(frame->number, frame->time_s, name, FromImage(frame->image));
}

}  // namespace

void BindTracking(py::module_& module) {
  py::class_<FrameSource>(module, "Frames")
      .def(py::init([](const std::string& path, int every) {
        const py::gil_scoped_release release;
        FrameOptions options;
        options.every = every;
        return OpenFrames(path, options);
      }))
      .def("next", &NextFrame);
  py::class_<Tracker>(module, "Tracker")
      .def(py::init(&MakeTracker), py::arg(), py::arg().noconvert(), py::arg(),
           py::arg().noconvert(), py::arg(), py::arg(), py::arg(), py::arg(), py::arg(), py::arg(),
           py::keep_alive<1, 2>())
      .def("find", &Find, py::arg().noconvert())
      .def_property_readonly("region",
                             [](const Tracker& tracker) {
                               const PixelBox& box = tracker.box();
                               return py::make_tuple(box.x, box.y, box.width, box.height);
                             })
      .def_property_readonly(
          "features", [](const Tracker& tracker) { return FromFeatures(tracker.features()); });
}

}  // namespace pliant::python
