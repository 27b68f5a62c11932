// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/db_copy.h"

#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/engine/copy_database.h"

namespace pliant::cli {
namespace {

// What the rankings of both say, as a list of differences.
RankingsCompared Compare(const CopyOptions& copy, std::uint64_t count) {
  const auto open = [](const std::filesystem::path& database) {
    EngineOptions engine;
    engine.database = database;
    engine.descriptor.clear();
    engine.create = false;
    engine.load_descriptor = false;
    engine.read_only = true;
    return Engine(engine);
  };
  Engine from = open(copy.from);
  Engine to = open(copy.to);
  return CompareRankings(from, to, count);
}

}  // namespace

ExitStatus RunCopy(const CopyCommandOptions& options) {
  CopyOptions copy;
  copy.from = options.from;
  copy.to = options.to;
  copy.commit_every = options.commit_every;
  Interrupt interrupt;
  copy.stop = interrupt.token();
  CopyResult result;
  {
    Progress progress("pictures");
    copy.progress = [&](std::uint64_t done, std::uint64_t total) { progress.Count(done, total); };
    result = CopyDatabase(copy);
  }
  const RankingsCompared compared = Compare(copy, options.compare);
  if (options.json) {
    PrintJson({{"collections", result.collections},
               {"copied", result.copied},
               {"unchanged", result.unchanged},
               {"extra", result.extra},
               {"without_content", result.without_content},
               {"vocabularies", result.vocabularies},
               {"keys", result.keys},
               {"rankings_compared", compared.compared},
               {"differences", compared.differences}});
  } else {
    Print("copied " + std::to_string(result.copied) + " pictures, " +
          std::to_string(result.unchanged) + " were there, of " +
          std::to_string(result.collections) + " collections; " +
          std::to_string(result.vocabularies) + " vocabularies, " + std::to_string(result.keys) +
          " API keys");
    Print("compared " + std::to_string(compared.compared) + " rankings: " +
          (compared.differences.empty() ? "all the same"
                                        : std::to_string(compared.differences.size()) + " differ"));
    for (const std::string& difference : compared.differences) Print(difference);
  }
  if (result.extra > 0) {
    Message(std::to_string(result.extra) +
            " pictures are in the copy and not, or not any more, in what was copied");
  }
  if (result.without_content > 0) {
    Message("of " + std::to_string(result.without_content) +
            " pictures there are no uploaded bytes to copy");
  }
  return compared.differences.empty() ? ExitStatus::kDone : ExitStatus::kFailed;
}

}  // namespace pliant::cli
