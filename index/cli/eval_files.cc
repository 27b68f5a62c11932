// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/eval_files.h"

#include <string>
#include <utility>
#include <vector>

#include "descriptor/features/descriptor.h"
#include "index/cli/output.h"
#include "index/cli/write_file.h"

namespace pliant::cli {

void AddCsvFlag(CLI::App& app, std::filesystem::path& csv, const std::string& help) {
  app.add_option("--csv", csv, help + "; - = standard output")->type_name("FILE");
}

CLI::Validator KnownDescriptorChoice() {
  std::vector<std::string> known = DescriptorNames();
  known.emplace_back("sift+repeats");
  const CLI::Validator one = OneOf(std::move(known));
  return CLI::Validator(
      [one](std::string& text) {
        std::string name = text.substr(0, text.find('='));
        name.erase(0, name.find(':') + 1);  // npos + 1 is 0
        return one(name);
      },
      "");
}

void CheckCsv(const std::filesystem::path& csv, bool json) {
  if (csv == kStandardOutput) ClaimStandardOutput("--csv", json);
  if (!csv.empty()) CheckWritable(csv);
}

}  // namespace pliant::cli
