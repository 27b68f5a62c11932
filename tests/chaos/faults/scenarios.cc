// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/chaos/faults/scenarios.h"

#include <stdexcept>

#include "descriptor/base/sha256.h"
#include "index/import/folder_import.h"
#include "index/store/open_store.h"
#include "tests/chaos/faults/contents.h"
#include "tests/unit/index_test_images.h"

namespace pliant::chaos {
namespace {

namespace fs = std::filesystem;

constexpr const char* kOriginals = "originals";

void Add(Engine& engine, const std::string& collection, const std::string& id, std::uint64_t seed,
         const std::string& object) {
  AddRequest request;
  request.collection = collection;
  request.id = id;
  request.bytes = ImageBytes(seed);
  request.object = object;
  request.metadata = R"({"seed":)" + std::to_string(seed) + "}";
  request.source = "somewhere/" + id;
  engine.Add(request);
}

void Train(Engine& engine, const std::string& collection, int words) {
  TrainOptions options;
  options.collection = collection;
  options.words = words;
  options.threads = 1;
  engine.TrainVocabulary(options);
}

ApiKeyRecord Key(const std::string& id) {
  return {id,      "name of " + id,
          "write", Sha256Hex(ImageBytes(static_cast<std::uint64_t>(id.back()))),
          1,       0};
}

JobRecord Job(const std::string& state) {
  JobRecord job;
  job.id = "job-1";
  job.kind = "import";
  job.state = state;
  return job;
}

void Empty(const fs::path& folder) { WriteImage({}, folder); }

// Three collections; an image that two of them have; two vocabularies, and one.
void Fill(const fs::path& folder, bool into_files) {
  Empty(folder);
  EngineOptions options = OptionsFor(folder);
  if (into_files) options.originals_dir = folder / kOriginals;
  Engine engine(options);
  engine.CreateCollection("other");
  engine.CreateCollection("third");
  Add(engine, "default", "p1", 1, "o1");
  Add(engine, "default", "p2", 2, "o1");
  Add(engine, "default", "p3", 3, "o2");
  Train(engine, "default", 8);
  Train(engine, "default", 6);
  Add(engine, "other", "q1", 1, "x");
  Add(engine, "other", "q4", 4, "y");
  Train(engine, "other", 7);
  Add(engine, "third", "r2", 2, "");
  Add(engine, "third", "r5", 5, "");
  engine.ChangeAliases({{"live", "default"}, {"old", "other"}});
  const auto service = OpenServiceStore(options.database);
  service->AddKey(Key("key-1"));
}

fs::path FileOf(const fs::path& folder, std::uint64_t seed) {
  const std::string sha256 = Sha256Hex(ImageBytes(seed));
  return folder / kOriginals / sha256.substr(0, 2) / sha256;
}

// Images of a folder beside the simulated disk.
const fs::path& ImportFolder() {
  static const testing::TemporaryFolder folder;
  static const fs::path path = [] {
    for (const std::uint64_t seed : {6, 7}) {
      testing::WriteBytes(folder / ("image-" + std::to_string(seed) + ".png"), ImageBytes(seed));
    }
    return folder.path();
  }();
  return path;
}

void Import(Engine& engine, const Acknowledge& done) {
  FolderImportOptions options;
  options.threads = 1;
  options.max_bytes = 1 << 20;
  options.root = fs::canonical(ImportFolder());
  options.add = [&](const AddRequest& request) {
    AddResult result = engine.Add(request);
    done();
    return result;
  };
  const ImageFiles files = FindImages({options.root}, ObjectFrom::kStem);
  const FolderImportResult result = ImportImages(engine, files, options);
  if (!result.skipped.empty()) throw std::runtime_error("skipped: " + result.skipped[0].reason);
}

void LookAfterService(const fs::path& folder, const Acknowledge& done) {
  const auto service = OpenServiceStore(folder / "a.db");
  if (service->Keys().size() == 1) service->AddKey(Key("key-2"));
  done();
  service->RevokeKey("key-1");
  done();
  service->SaveJob(Job("queued"));
  done();
  service->SaveJob(Job("done"));
  done();
}

using Act = std::function<void(Engine&)>;

// Acknowledged when it returns.
Scenario Simple(const std::string& name, bool files, const Act& act) {
  Scenario scenario;
  scenario.name = name + (files ? "_files" : "");
  scenario.prepare = [files](const fs::path& folder) { Fill(folder, files); };
  scenario.act = [act](Engine& engine, const fs::path&, const Acknowledge& done) {
    act(engine);
    done();
  };
  return scenario;
}

void AddImageScenarios(bool files, std::vector<Scenario>* all) {
  all->push_back(Simple("upload", files, [](Engine& e) { Add(e, "default", "p6", 6, "o6"); }));
  all->back().describes = true;
  all->push_back(Simple("replace", files, [](Engine& e) { Add(e, "default", "p3", 4, "o1"); }));
  all->push_back(Simple("remove", files, [](Engine& e) { e.Remove("default", "p3"); }));
  all->push_back(
      Simple("remove_object", files, [](Engine& e) { e.RemoveObject("default", "o1"); }));
  all->push_back(Simple("relabel", files, [](Engine& e) {
    ImageChange change;
    change.metadata = R"({"shelf": 4, "seed": null})";
    e.Change("default", "p1", change);
  }));
  all->push_back(Simple("move", files, [](Engine& e) {
    ImageChange change;
    change.object = "o1";
    e.Change("default", "p3", change);
  }));
  const auto rename = [](Engine& e, const std::string& name, bool merge) {
    if (!e.GetObject("default", "o1")) return;  // done before
    ObjectChange change;
    change.name = name;
    change.merge = merge;
    e.ChangeObject("default", "o1", change);
  };
  all->push_back(Simple("rename_object", files, [=](Engine& e) { rename(e, "o9", false); }));
  all->push_back(Simple("merge_objects", files, [=](Engine& e) { rename(e, "o2", true); }));
  all->push_back(
      Simple("remove_collection", files, [](Engine& e) { e.RemoveCollection("other"); }));
  Scenario folder = Simple("import", files, {});
  folder.describes = true;
  folder.act = [](Engine& engine, const fs::path&, const Acknowledge& done) {
    Import(engine, done);
  };
  all->push_back(std::move(folder));
}

void AddVocabularyScenarios(std::vector<Scenario>* all) {
  all->push_back(Simple("train_first", false, [](Engine& e) {
    if (e.ListVocabularies("third").empty()) Train(e, "third", 5);
  }));
  all->push_back(Simple("train_another", false, [](Engine& e) {
    if (e.ListVocabularies("default").size() == 2) Train(e, "default", 5);
  }));
  all->push_back(Simple("use_vocabulary", false, [](Engine& e) {
    for (const VocabularyRecord& vocabulary : e.ListVocabularies("default")) {
      if (vocabulary.words == 6) e.UseVocabulary("default", vocabulary.id);
    }
  }));
}

void AddServiceScenarios(std::vector<Scenario>* all) {
  all->push_back(
      Simple("create_collection", false, [](Engine& e) { e.CreateCollection("fourth"); }));
  all->push_back(Simple("aliases", false, [](Engine& e) {
    e.ChangeAliases({{"live", "third"}, {"next", "other"}});
  }));
  all->push_back(Simple("display_name", false, [](Engine& e) {
    e.ChangeCollection("other", {.display_name = "Another"});
  }));
  Scenario service = Simple("keys_and_jobs", false, {});
  service.act = [](Engine&, const fs::path& folder, const Acknowledge& done) {
    LookAfterService(folder, done);
  };
  all->push_back(std::move(service));
  Scenario backup = Simple("backup", false, {});
  backup.also = "backup.db";
  backup.act = [](Engine& engine, const fs::path& folder, const Acknowledge& done) {
    try {
      engine.Backup(folder / "backup.db");
    } catch (const Error& error) {
      if (error.reason() != "backup_exists") throw;
    }
    done();
  };
  all->push_back(std::move(backup));
}

void AddOriginalsScenarios(std::vector<Scenario>* all) {
  const auto move = [&](const std::string& name, bool files, const std::string& target) {
    Scenario scenario = Simple(name, files, {});
    scenario.name = name;
    scenario.act = [target](Engine& engine, const fs::path& folder, const Acknowledge& done) {
      engine.MoveOriginals(target.empty() ? fs::path() : folder / target);
      done();
    };
    all->push_back(std::move(scenario));
  };
  move("move_to_files", false, kOriginals);
  move("move_to_database", true, "");
  move("move_to_other_files", true, "elsewhere");
  all->back().leaves = kOriginals;
  Scenario restore =
      Simple("restore_file", true, [](Engine& e) { Add(e, "default", "p3", 3, "o2"); });
  restore.name = "restore_file";
  restore.prepare = [](const fs::path& folder) {
    Fill(folder, true);
    fs::remove(FileOf(folder, 3));
  };
  all->push_back(std::move(restore));
  Scenario sweep = Simple("sweep", true, [](Engine& e) { e.SweepOriginals(); });
  sweep.name = "sweep";
  sweep.prepare = [](const fs::path& folder) {
    Fill(folder, true);
    testing::WriteBytes(FileOf(folder, 8), ImageBytes(8));
    testing::WriteBytes(folder / kOriginals / "incoming" / "left.1-1", ImageBytes(9));
  };
  all->push_back(std::move(sweep));
  Scenario create;
  create.name = "create_database_files";
  create.prepare = Empty;
  create.into_files = true;
  create.opens = true;
  create.act = [](Engine&, const fs::path&, const Acknowledge&) {};
  all->push_back(std::move(create));
  Scenario begin = Simple("begin_files", false, {});
  begin.into_files = true;
  begin.opens = true;
  begin.act = [](Engine&, const fs::path&, const Acknowledge&) {};
  all->push_back(std::move(begin));
}

}  // namespace

const std::vector<Scenario>& Scenarios() {
  static const std::vector<Scenario> scenarios = [] {
    std::vector<Scenario> all;
    AddImageScenarios(false, &all);
    AddImageScenarios(true, &all);
    AddVocabularyScenarios(&all);
    AddServiceScenarios(&all);
    AddOriginalsScenarios(&all);
    return all;
  }();
  return scenarios;
}

const Scenario& ScenarioOf(const std::string& name) {
  for (const Scenario& scenario : Scenarios()) {
    if (scenario.name == name) return scenario;
  }
  throw std::invalid_argument("no scenario " + name);
}

EngineOptions OptionsOf(const Scenario& scenario, const fs::path& folder) {
  EngineOptions options = OptionsFor(folder);
  if (scenario.into_files) options.originals_dir = folder / kOriginals;
  return options;
}

}  // namespace pliant::chaos
