// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/simulate.h"
#include "python/native/bindings.h"
#include "python/native/interruptible.h"

namespace pliant::python {
namespace {

// Fields of SimulateOptions by their names; the Python side passes no others.
SimulateOptions ToOptions(const py::dict& given) {
  SimulateOptions o;
  const auto take = [&given](const char* name, auto& field) {
    if (given.contains(name)) field = given[name].cast<std::decay_t<decltype(field)>>();
  };
  take("textures", o.textures);
  take("out", o.out);
  take("preset", o.preset);
  take("format", o.format);
  take("scenes", o.scenes);
  take("first", o.first);
  take("distractors", o.distractors);
  take("views", o.views);
  take("width", o.width);
  take("height", o.height);
  take("colour", o.colour);
  take("strength", o.strength);
  take("occluders", o.occluders);
  take("turn_deg", o.turn_deg);
  take("least_scale", o.least_scale);
  take("seed", o.seed);
  take("jobs", o.jobs);
  return o;
}

py::dict RunSimulation(const py::dict& given, const py::object& progress) {
  SimulateOptions options = ToOptions(given);
  std::stop_source stop;
  Callback heard(progress, stop);
  options.progress = [&](std::int64_t done, std::int64_t total) {
    heard(done, total);
    return !stop.stop_requested();
  };
  const SimulateReport report =
      Interruptibly(stop, heard, [&options] { return Simulate(options); });
  py::list skipped;
  for (const auto& [file, reason] : report.skipped)
    skipped.append(py::make_tuple(py::bytes(file), py::bytes(reason)));
  py::dict result;
  result["scenes"] = report.scenes;
  result["unchanged"] = report.unchanged;
  result["images"] = report.images;
  result["textures"] = report.textures;
  result["seconds"] = report.seconds;
  result["mean_stretch"] = report.mean_stretch;
  result["worst_stretch"] = report.worst_stretch;
  result["skipped"] = skipped;
  return result;
}

}  // namespace

void BindSimulation(py::module_& module) { module.def("simulate", &RunSimulation); }

}  // namespace pliant::python
