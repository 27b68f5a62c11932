// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/eval_files.h"

#include <string>
#include <utility>
#include <vector>

#include "descriptor/features/descriptor.h"
#include "index/cli/output.h"
#include "index/cli/write_file.h"
#include "index/cli/write_picture.h"

namespace pliant::cli {

void AddEvalFileFlags(CLI::App& app, EvalFiles& files, const std::string& csv_help,
                      const std::string& plot_help) {
  app.add_option("--csv", files.csv, csv_help + "; - = standard output")->type_name("FILE");
  app.add_option("--plot", files.plot, plot_help + "; - = standard output")->type_name("OUT.png");
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

void CheckEvalFiles(const EvalFiles& files, bool json) {
  if (files.csv == kStandardOutput) ClaimStandardOutput("--csv", json);
  if (files.plot == kStandardOutput) ClaimStandardOutput("--plot", json);
  if (!files.csv.empty()) CheckWritable(files.csv);
  if (files.plot.empty()) return;
  CheckPictureName(files.plot);
  CheckWritable(files.plot);
}

}  // namespace pliant::cli
