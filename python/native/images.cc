// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The images of an index.
#include <optional>

#include "index/json/record_json.h"
#include "python/native/convert.h"
#include "python/native/open_index.h"

namespace pliant::python {
namespace {

// (outcome, the JSON text of the record)
std::pair<std::string, std::string> Add(const OpenIndex& index, const py::bytes& data,
                                        const std::string& object,
                                        const std::optional<std::string>& id,
                                        const std::string& metadata, const std::string& source,
                                        int threads) {
  AddRequest request;
  request.collection = index.collection();
  request.id = id;
  request.object = object;
  request.metadata = metadata;
  request.source = source;
  request.bytes = ViewOf(data);
  request.threads = threads;
  return index.Call([&request](Engine& engine, const std::string&) {
    const AddResult result = engine.Add(request);
    return std::pair<std::string, std::string>(OutcomeName(result.outcome),
                                               ToText(ImageJson(result.image)));
  });
}

// A page of images after an id, in order of ids, as the JSON text of a list.
std::string List(const OpenIndex& index, const std::string& after,
                 const std::optional<std::string>& object, int limit) {
  return index.Call([&](Engine& engine, const std::string& collection) {
    Json page = Json::array();
    for (const ImageRecord& image : engine.List(
             {.collection = collection, .object = object, .after_id = after, .limit = limit}))
      page.push_back(ImageJson(image));
    return ToText(page);
  });
}

// The JSON text of the record as it is then. Nothing = stays as it is; `metadata` is a merge patch.
std::string Change(const OpenIndex& index, const std::string& id,
                   const std::optional<std::string>& object,
                   const std::optional<std::string>& metadata,
                   const std::optional<std::string>& source) {
  ImageChange change;
  change.object = object;
  change.metadata = metadata;
  change.source = source;
  return index.Call([&](Engine& engine, const std::string& collection) {
    return ToText(ImageJson(engine.Change(collection, id, change)));
  });
}

// How many images the object has by its new name.
std::uint64_t RenameObject(const OpenIndex& index, const std::string& object,
                           const std::string& name, bool merge) {
  ObjectChange change;
  change.name = name;
  change.merge = merge;
  return index.Call([&](Engine& engine, const std::string& collection) {
    return engine.ChangeObject(collection, object, change).images;
  });
}

py::bytes Content(const OpenIndex& index, const std::string& id) {
  const auto bytes = index.Call([&id](Engine& engine, const std::string& collection) {
    return engine.GetContent(collection, id);
  });
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

void BindImages(py::class_<OpenIndex>& index) {
  index.def("add", &Add, py::arg("data"), py::arg("object"), py::arg("id"), py::arg("metadata"),
            py::arg("source"), py::arg("threads"));
  index.def("list", &List, py::arg("after"), py::arg("object"), py::arg("limit"));
  index.def("get", [](const OpenIndex& self, const std::string& id) {
    return self.Call([&id](Engine& engine, const std::string& collection) {
      return ToText(ImageJson(engine.Get(collection, id)));
    });
  });
  index.def("features", [](const OpenIndex& self, const std::string& id) {
    return FromFeatures(self.Call([&id](Engine& engine, const std::string& collection) {
      return engine.GetFeatures(collection, id);
    }));
  });
  index.def("content", &Content);
  index.def("change", &Change);
  index.def("rename_object", &RenameObject);
  index.def("remove", [](const OpenIndex& self, const std::string& id) {
    return self.Call([&id](Engine& engine, const std::string& collection) {
      return engine.Remove(collection, id);
    });
  });
  index.def("remove_object", [](const OpenIndex& self, const std::string& object) {
    return self.Call([&object](Engine& engine, const std::string& collection) {
      return engine.RemoveObject(collection, object);
    });
  });
  index.def("objects", [](const OpenIndex& self, const std::string& after, int limit) {
    return self.Call([&](Engine& engine, const std::string& collection) {
      std::vector<std::pair<std::string, std::uint64_t>> page;
      for (const ObjectRecord& object : engine.ListObjects(collection, after, limit))
        page.emplace_back(object.object, object.images);
      return page;
    });
  });
}

}  // namespace pliant::python
