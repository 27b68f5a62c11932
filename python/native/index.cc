// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The engine as Python holds it: images, searches, vocabularies and upkeep of one collection.
// Records and answers travel as the JSON texts that the command line prints.
#include <array>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/features/foreign_features.h"
#include "index/engine/engine.h"
#include "index/import/folder_import.h"
#include "index/json/record_json.h"
#include "index/json/result_json.h"
#include "index/records/filter.h"
#include "python/native/bindings.h"
#include "python/native/interruptible.h"

namespace pliant::python {
namespace {

// One collection of one database, until it is closed. Thread-safe: calls that are running when
// another thread closes it come to their end, and the last of them closes the database.
class OpenIndex {
 public:
  OpenIndex(std::shared_ptr<Engine> engine, std::string collection)
      : engine_(std::move(engine)), collection_(std::move(collection)) {}

  const std::string& collection() const { return collection_; }

  // Throws kInvalidArgument "closed" once it is closed.
  std::shared_ptr<Engine> engine() const {
    const std::lock_guard lock(mutex_);
    if (!engine_) throw Error(ErrorCode::kInvalidArgument, "closed", "the index is closed");
    return engine_;
  }
  void Close() {
    std::shared_ptr<Engine> last;
    const std::lock_guard lock(mutex_);
    last.swap(engine_);
  }

  // Calls work(engine, collection) without the GIL.
  template <typename Work>
  auto Call(Work work) const {
    const py::gil_scoped_release release;
    const std::shared_ptr<Engine> open = engine();
    return work(*open, collection_);
  }

 private:
  mutable std::mutex mutex_;  // guards engine_
  std::shared_ptr<Engine> engine_;
  std::string collection_;
};

// A method of Python's: calls work(engine, collection, arguments...) without the GIL.
template <typename Result, typename... Arguments>
auto Method(Result (*work)(Engine&, const std::string&, Arguments...)) {
  return [work](const OpenIndex& index, Arguments... arguments) {
    return index.Call([&](Engine& engine, const std::string& collection) {
      return work(engine, collection, arguments...);
    });
  };
}

template <typename Value, std::size_t count>
Value Named(const char* field, const std::string& given,
            const std::array<std::pair<const char*, Value>, count>& names) {
  std::string known;
  for (const auto& [name, value] : names) {
    if (given == name) return value;
    known += (known.empty() ? "" : ", ") + std::string(name);
  }
  throw Error(ErrorCode::kInvalidArgument, std::string(field) + "_invalid",
              std::string(field) + " must be one of " + known);
}

std::unique_ptr<OpenIndex> Open(const std::string& database, const std::string& collection,
                                const std::string& descriptor, const py::object& own,
                                const std::string& model, bool create, bool read_only,
                                std::optional<int> max_keypoints, std::optional<int> max_side,
                                bool keep_originals, const std::string& originals_dir,
                                double busy_timeout) {
  EngineOptions options;
  if (!own.is_none()) {
    options.custom_descriptor =
        MakeForeignDescriptor(ForeignDescriptorInfo(ToFeatures(own, "descriptor")));
  }
  const py::gil_scoped_release release;
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
  engine->GetCollection(collection);  // throws if it does not exist
  return std::make_unique<OpenIndex>(std::move(engine), collection);
}

// --- images and objects

// (outcome, the JSON text of the record); `features`: null if the bytes are to be described.
std::pair<std::string, std::string> AddAs(const OpenIndex& index, Bytes bytes,
                                          const Features* features, const std::string& object,
                                          const std::optional<std::string>& id,
                                          const std::string& metadata, const std::string& source,
                                          int threads) {
  AddRequest request;
  request.collection = index.collection();
  request.id = id;
  request.object = object;
  request.metadata = metadata;
  request.source = source;
  request.bytes = bytes;
  request.threads = threads;
  return index.Call([&](Engine& engine, const std::string&) {
    const AddResult result =
        features != nullptr ? engine.AddFeatures(request, *features) : engine.Add(request);
    return std::pair<std::string, std::string>(OutcomeName(result.outcome),
                                               ToText(ImageJson(result.image)));
  });
}

std::pair<std::string, std::string> Add(const OpenIndex& index, const py::bytes& data,
                                        const std::string& object,
                                        const std::optional<std::string>& id,
                                        const std::string& metadata, const std::string& source,
                                        int threads) {
  return AddAs(index, ViewOf(data), nullptr, object, id, metadata, source, threads);
}

std::pair<std::string, std::string> AddFeatures(const OpenIndex& index, const py::object& features,
                                                const std::string& object,
                                                const std::optional<std::string>& id,
                                                const std::string& metadata,
                                                const std::string& source, int threads) {
  const Features given = ToFeatures(features, "features");
  return AddAs(index, {}, &given, object, id, metadata, source, threads);
}

std::string AddFolders(const OpenIndex& index, const std::vector<std::string>& folders,
                       const std::string& object_from, int threads, const py::object& progress) {
  const ObjectFrom from = Named(
      "object_from", object_from,
      std::array{std::pair{"auto", ObjectFrom::kAuto}, std::pair{"folder", ObjectFrom::kFolder},
                 std::pair{"stem", ObjectFrom::kStem}, std::pair{"none", ObjectFrom::kNone}});
  const std::shared_ptr<Engine> engine = index.engine();
  std::stop_source stop;
  Callback heard(progress, stop);
  const FolderImportResult result = Interruptibly(stop, heard, [&] {
    const ImageFiles files = FindImages({folders.begin(), folders.end()}, from);
    FolderImportOptions options;
    options.collection = index.collection();
    options.threads = threads;
    options.max_bytes = DecodeOptions().max_bytes;
    options.stop = stop.get_token();
    options.progress = [&](std::uint64_t done, std::uint64_t total) { heard(done, total); };
    return ImportImages(*engine, files, options);
  });
  Json skipped = Json::array();
  for (const SkippedFile& file : result.skipped)
    skipped.push_back({{"file", file.file}, {"code", file.code}, {"reason", file.reason}});
  return ToText({{"indexed", result.indexed},
                 {"unchanged", result.unchanged},
                 {"skipped", std::move(skipped)},
                 {"system_files", result.system_files}});
}

// A page of images in order of ids, as the JSON text of a list, and where the next page begins.
std::pair<std::string, std::optional<std::string>> List(Engine& engine,
                                                        const std::string& collection,
                                                        const std::string& after,
                                                        const std::optional<std::string>& object,
                                                        int limit) {
  ImageListing list;
  list.which.collection = collection;
  list.which.object = object;
  list.after = after;
  list.limit = limit;
  const ImagePage page = engine.ListPage(list);
  Json images = Json::array();
  for (const ImageRecord& image : page.records) images.push_back(ImageJson(image));
  return {ToText(images), page.next};
}

std::string Get(Engine& engine, const std::string& collection, const std::string& id) {
  return ToText(ImageJson(engine.Get(collection, id)));
}

py::tuple GetFeatures(const OpenIndex& index, const std::string& id) {
  return FromFeatures(index.Call([&id](Engine& engine, const std::string& collection) {
    return engine.GetFeatures(collection, id);
  }));
}

py::bytes Content(const OpenIndex& index, const std::string& id) {
  return ToBytes(index.Call([&id](Engine& engine, const std::string& collection) {
    return engine.GetContent(collection, id);
  }));
}

// The JSON text of the record as it is then. Nothing = stays as it is; `metadata` is a merge patch.
std::string Change(Engine& engine, const std::string& collection, const std::string& id,
                   const std::optional<std::string>& object,
                   const std::optional<std::string>& metadata,
                   const std::optional<std::string>& source) {
  ImageChange change;
  change.object = object;
  change.metadata = metadata;
  change.source = source;
  return ToText(ImageJson(engine.Change(collection, id, change)));
}

bool Remove(Engine& engine, const std::string& collection, const std::string& id) {
  return engine.Remove(collection, id);
}

// How many images the object has by its new name.
std::uint64_t RenameObject(Engine& engine, const std::string& collection, const std::string& object,
                           const std::string& name, bool merge) {
  ObjectChange change;
  change.name = name;
  change.merge = merge;
  return engine.ChangeObject(collection, object, change).images;
}

std::uint64_t RemoveObject(Engine& engine, const std::string& collection,
                           const std::string& object) {
  return engine.RemoveObject(collection, object);
}

using NamedCounts = std::vector<std::pair<std::string, std::uint64_t>>;

// A page of objects and their numbers of images, and where the next page begins.
std::pair<NamedCounts, std::optional<std::string>> Objects(Engine& engine,
                                                           const std::string& collection,
                                                           const std::string& after, int limit) {
  ObjectListing list;
  list.which.collection = collection;
  list.after = after;
  list.limit = limit;
  const ObjectPage page = engine.ListPage(list);
  NamedCounts counts;
  for (const ListedObject& object : page.records)
    counts.emplace_back(object.record.object, object.record.images);
  return {std::move(counts), page.next};
}

// --- searches

// Fields of SearchOptions by their names in the HTTP interface; the Python side passes no others.
SearchOptions ToOptions(const py::dict& given, const std::string& collection) {
  SearchOptions options;
  options.collection = collection;
  options.limit = given["top"].cast<std::size_t>();
  options.offset = given["offset"].cast<std::size_t>();
  options.rank = Named("rank", given["rank"].cast<std::string>(),
                       std::array{std::pair{"neighbours", RankMethod::kNeighbours},
                                  std::pair{"histogram", RankMethod::kHistogram}});
  options.group_by =
      Named("group_by", given["group_by"].cast<std::string>(),
            std::array{std::pair{"object", GroupBy::kObject}, std::pair{"image", GroupBy::kImage}});
  options.verify =
      Named("verify", given["verify"].cast<std::string>(),
            std::array{std::pair{"auto", Verification::kAuto}, std::pair{"tps", Verification::kTps},
                       std::pair{"none", Verification::kNone}});
  options.verify_depth = given["verify_depth"].cast<std::size_t>();
  options.max_instances = given["instances"].cast<int>();
  options.second_pass = given["closer_look"].cast<bool>();
  if (const auto region = given["region"].cast<std::optional<std::array<double, 4>>>()) {
    options.region = Region{(*region)[0], (*region)[1], (*region)[2], (*region)[3]};
  }
  options.min_score = given["min_score"].cast<double>();
  options.object = given["object"].cast<std::optional<std::string>>();
  const auto filter = given["filter"].cast<std::string>();
  if (!filter.empty()) options.filter = ParseFilter(filter);
  options.explain = given["explain"].cast<bool>();
  options.threads = given["threads"].cast<int>();
  return options;
}

template <typename Ask>
std::string Answer(const OpenIndex& index, const py::dict& given, Ask ask) {
  const SearchOptions options = ToOptions(given, index.collection());
  return index.Call([&](Engine& engine, const std::string&) {
    const auto start = std::chrono::steady_clock::now();
    const SearchResult result = [&] {
      try {
        return ask(engine, options);
      } catch (const Error& error) {
        if (error.reason() != "no_vocabulary") throw;
        throw Error(error.code(), error.reason(),
                    error.what() + std::string(": add images, then call train()"));
      }
    }();
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
    return ToText(SearchResultJson(result, took.count()));
  });
}

std::string Search(const OpenIndex& index, const py::bytes& data, const py::dict& given) {
  const Bytes bytes = ViewOf(data);
  return Answer(index, given, [bytes](Engine& engine, const SearchOptions& options) {
    return engine.Search(bytes, options);
  });
}

std::string SearchStored(const OpenIndex& index, const std::string& id, const py::dict& given) {
  return Answer(index, given, [&id](Engine& engine, const SearchOptions& options) {
    return engine.SearchStored(id, options);
  });
}

std::string SearchFeatures(const OpenIndex& index, const py::object& query, const py::dict& given) {
  const Features features = ToFeatures(query, "features");
  return Answer(index, given, [&features](Engine& engine, const SearchOptions& options) {
    return engine.SearchFeatures(features, options);
  });
}

// --- vocabularies and upkeep

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

std::string Vocabularies(Engine& engine, const std::string& collection) {
  Json all = Json::array();
  for (const VocabularyRecord& v : engine.ListVocabularies(collection))
    all.push_back(VocabularyJson(v));
  return ToText(all);
}

void Use(Engine& engine, const std::string& collection, std::int64_t id) {
  engine.UseVocabulary(collection, id);
}

std::string DescribeCollection(Engine& engine, const std::string& collection) {
  return ToText(CollectionJson(engine.GetCollection(collection)));
}

std::vector<std::string> Check(Engine& engine, const std::string&) { return engine.Check(); }

void Backup(Engine& engine, const std::string&, const std::string& path) { engine.Backup(path); }

}  // namespace

void BindIndex(py::module_& module) {
  py::class_<OpenIndex>(module, "Index")
      .def(py::init(&Open), py::arg("database"), py::arg("collection"), py::arg("descriptor"),
           py::arg("own"), py::arg("model"), py::arg("create"), py::arg("read_only"),
           py::arg("max_keypoints"), py::arg("max_side"), py::arg("keep_originals"),
           py::arg("originals_dir"), py::arg("busy_timeout"))
      .def("close", &OpenIndex::Close, py::call_guard<py::gil_scoped_release>())
      .def("add", &Add)
      .def("add_features", &AddFeatures)
      .def("add_folders", &AddFolders)
      .def("list", Method(&List))
      .def("get", Method(&Get))
      .def("features", &GetFeatures)
      .def("content", &Content)
      .def("change", Method(&Change))
      .def("remove", Method(&Remove))
      .def("rename_object", Method(&RenameObject))
      .def("remove_object", Method(&RemoveObject))
      .def("objects", Method(&Objects))
      .def("search", &Search)
      .def("search_stored", &SearchStored)
      .def("search_features", &SearchFeatures)
      .def("train", &Train)
      .def("vocabularies", Method(&Vocabularies))
      .def("use", Method(&Use))
      .def("describe_collection", Method(&DescribeCollection))
      .def("check", Method(&Check))
      .def("backup", Method(&Backup));
}

}  // namespace pliant::python
