// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/db_check.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <unistd.h>

#include "index/cli/output.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

void RequireOwnOriginals(Engine& engine) {
  const auto originals = engine.DescribeOriginals();
  if (originals && originals->owned) return;
  throw Error(ErrorCode::kConflict, "originals_foreign",
              originals ? "the directory " + originals->directory.string() +
                              " is not, or not yet, this database's: nothing was removed"
                        : "the originals are in the database: there is no directory to sweep");
}

// The store tells several things in one text.
void PrintLines(const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) Print(ToDisplayText(line));
}

// A backup has no files of the directory of originals: problems that name one are not mended by it.
void Advise(const std::optional<OriginalsRecord>& originals,
            const std::vector<std::string>& problems) {
  const std::string directory = originals ? originals->directory.string() : "";
  const auto of_files =
      std::count_if(problems.begin(), problems.end(), [&](const std::string& problem) {
        return !directory.empty() && problem.find(directory) != std::string::npos;
      });
  if (of_files > 0) {
    Message("originals are files of " + directory +
            " and in no backup: mount that directory, put a copy of it there, or name the one "
            "that has them with --originals-dir");
  }
  if (of_files == std::ssize(problems)) return;
  Message("pliant db restore BACKUP --db FILE --replace puts a backup in its place");
}

// A file that this user may not write is checked as it is.
Access AccessForCheck(const EngineOptions& engine, bool sweep) {
  const std::string database = engine.database.string();
  const bool is_file = access(database.c_str(), F_OK) == 0;
  const bool read = is_file && !sweep && access(database.c_str(), W_OK) != 0;
  return read ? Access::kRead : Access::kWrite;
}

}  // namespace

Engine OpenForCare(EngineOptions& options, Access access, bool with_index) {
  options.descriptor.clear();
  options.create = false;
  options.load_descriptor = false;
  options.load_index = with_index;
  options.read_only = access == Access::kRead;
  return Engine(options);
}

ExitStatus RunCheck(EngineOptions& opened, const CheckOptions& options) {
  Engine engine = OpenForCare(opened, AccessForCheck(opened, options.sweep));
  const std::vector<std::string> problems = engine.Check();
  std::uint64_t swept = 0;
  if (options.sweep) {
    RequireOwnOriginals(engine);
    swept = engine.SweepOriginals();
    if (!options.json) Print("removed " + std::to_string(swept) + " unreferenced files");
  }
  if (options.json) {
    Json list = Json::array();
    for (const std::string& problem : problems) list.push_back(ToDisplayText(problem));
    Json answer{{"ok", problems.empty()}, {"problems", std::move(list)}};
    if (options.sweep) answer["swept"] = swept;
    PrintJson(answer);
  } else if (problems.empty()) {
    Print("ok");
  } else {
    for (const std::string& problem : problems) PrintLines(problem);
    Advise(engine.DescribeOriginals(), problems);
  }
  return problems.empty() ? ExitStatus::kDone : ExitStatus::kFailed;
}

}  // namespace pliant::cli
