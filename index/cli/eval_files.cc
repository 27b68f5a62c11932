// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/eval_files.h"

#include "index/cli/write_file.h"
#include "index/cli/write_picture.h"

namespace pliant::cli {

void AddEvalFileFlags(CLI::App& app, EvalFiles& files, const std::string& csv_help,
                      const std::string& plot_help) {
  app.add_option("--csv", files.csv, csv_help)->type_name("FILE");
  app.add_option("--plot", files.plot, plot_help)->type_name("OUT.png");
}

void CheckEvalFiles(const EvalFiles& files) {
  if (!files.csv.empty()) CheckWritable(files.csv);
  if (files.plot.empty()) return;
  CheckPictureName(files.plot);
  CheckWritable(files.plot);
}

}  // namespace pliant::cli
