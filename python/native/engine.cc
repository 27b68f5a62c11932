// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Opening an index, training and upkeep. Records travel as the JSON that the command line prints.
#include <optional>
#include <vector>

#include <pybind11/stl.h>

#include "index/import/folder_import.h"
#include "index/json/record_json.h"
#include "python/native/bindings.h"
#include "python/native/interruptible.h"
#include "python/native/open_index.h"

namespace pliant::python {
namespace {

namespace py = pybind11;

std::unique_ptr<OpenIndex> Open(const std::string& database, const std::string& collection,
                                const std::string& descriptor, const std::string& model,
                                bool create, bool read_only, std::optional<int> max_keypoints,
                                std::optional<int> max_side, bool keep_originals,
                                const std::string& originals_dir, double busy_timeout) {
  const py::gil_scoped_release release;
  EngineOptions options;
  options.database = database;
  options.descriptor = descriptor;
  options.descriptor_options.model_path = model;
  options.create = create && !read_only;
  options.read_only = read_only;
  options.max_keypoints = max_keypoints;
  options.max_side_px = max_side;
  options.keep_originals = keep_originals;
  options.originals_dir = ParseOriginalsDir(originals_dir);
  options.busy_timeout_ms = static_cast<int>(busy_timeout * 1000);
  auto engine = std::make_shared<Engine>(options);
  if (options.create && collection != kDefaultCollection) engine->CreateCollection(collection);
  engine->GetCollection(collection);  // there is one
  return std::make_unique<OpenIndex>(std::move(engine), collection);
}

std::string Train(const OpenIndex& index, int words, int sample, std::uint64_t seed, int threads,
                  const py::object& progress) {
  const std::shared_ptr<Engine> engine = index.engine();
  std::stop_source stop;
  Callback heard(progress, stop);
  const VocabularyRecord record = Interruptibly(stop, heard, [&] {
    TrainOptions options;
    options.collection = index.collection();
    options.words = words;
    options.sample = sample;
    options.seed = seed;
    options.threads = threads;
    options.stop = stop.get_token();
    options.progress = [&](double done, double) { heard(done); };
    VocabularyRecord made = engine->TrainVocabulary(options);
    if (made.active) return made;
    UseOptions use;
    use.threads = threads;
    use.stop = stop.get_token();
    engine->UseVocabulary(index.collection(), made.id, use);
    made.active = true;
    return made;
  });
  return ToText(VocabularyJson(record));
}

Json SkippedJson(const SkippedFile& file) {
  return {{"file", file.file}, {"code", file.code}, {"reason", file.reason}};
}

std::string AddFolders(const OpenIndex& index, const std::vector<std::string>& folders,
                       const std::string& object_from, int threads, const py::object& progress) {
  static const std::pair<const char*, ObjectFrom> kNames[] = {{"auto", ObjectFrom::kAuto},
                                                              {"folder", ObjectFrom::kFolder},
                                                              {"stem", ObjectFrom::kStem},
                                                              {"none", ObjectFrom::kNone}};
  std::optional<ObjectFrom> named;
  for (const auto& [name, value] : kNames)
    if (object_from == name) named = value;
  if (!named) {
    throw Error(ErrorCode::kInvalidArgument, "object_from_invalid",
                "object_from must be auto, folder, stem or none");
  }
  const std::shared_ptr<Engine> engine = index.engine();
  std::stop_source stop;
  Callback heard(progress, stop);
  const FolderImportResult result = Interruptibly(stop, heard, [&] {
    const ImageFiles files = FindImages({folders.begin(), folders.end()}, *named);
    FolderImportOptions options;
    options.collection = index.collection();
    options.threads = threads;
    options.max_bytes = DecodeOptions().max_bytes;
    options.stop = stop.get_token();
    options.progress = [&](std::uint64_t done, std::uint64_t total) { heard(done, total); };
    return ImportImages(*engine, files, options);
  });
  Json skipped = Json::array();
  for (const SkippedFile& file : result.skipped) skipped.push_back(SkippedJson(file));
  return ToText({{"indexed", result.indexed},
                 {"unchanged", result.unchanged},
                 {"skipped", std::move(skipped)}});
}

std::string Vocabularies(const OpenIndex& index) {
  return index.Call([](Engine& engine, const std::string& collection) {
    Json all = Json::array();
    for (const VocabularyRecord& v : engine.ListVocabularies(collection))
      all.push_back(VocabularyJson(v));
    return ToText(all);
  });
}

}  // namespace

void BindUpkeep(py::class_<OpenIndex>& index) {
  index.def("train", &Train, py::arg("words"), py::arg("sample"), py::arg("seed"),
            py::arg("threads"), py::arg("progress"));
  index.def("add_folders", &AddFolders, py::arg("folders"), py::arg("object_from"),
            py::arg("threads"), py::arg("progress"));
  index.def("vocabularies", &Vocabularies);
  index.def("use", [](const OpenIndex& self, std::int64_t id) {
    self.Call([id](Engine& engine, const std::string& collection) {
      engine.UseVocabulary(collection, id);
    });
  });
  index.def("describe_collection", [](const OpenIndex& self) {
    return self.Call([](Engine& engine, const std::string& collection) {
      return ToText(CollectionJson(engine.GetCollection(collection)));
    });
  });
  index.def("check", [](const OpenIndex& self) {
    return self.Call([](Engine& engine, const std::string&) { return engine.Check(); });
  });
  index.def("backup", [](const OpenIndex& self, const std::string& path) {
    self.Call([&path](Engine& engine, const std::string&) { engine.Backup(path); });
  });
}

void BindEngine(py::module_& module) {
  py::class_<OpenIndex> index(module, "Index");
  index
      .def(py::init(&Open), py::arg("database"), py::arg("collection"), py::arg("descriptor"),
           py::arg("model"), py::arg("create"), py::arg("read_only"), py::arg("max_keypoints"),
           py::arg("max_side"), py::arg("keep_originals"), py::arg("originals_dir"),
           py::arg("busy_timeout"))
      .def("close", &OpenIndex::Close, py::call_guard<py::gil_scoped_release>())
      .def_property_readonly("is_open", &OpenIndex::is_open);
  BindImages(index);
  BindSearch(index);
  BindUpkeep(index);
}

}  // namespace pliant::python
