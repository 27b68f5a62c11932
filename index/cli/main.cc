// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <csignal>
#include <iostream>
#include <new>

#include "descriptor/image/prepare_decoders.h"
#include "index/cli/command.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/usage/usage.h"

namespace pliant::cli {
namespace {

constexpr const char* kFooter =
    "Exit status: 0 done, 1 failed, 2 wrong usage, 3 done but some inputs were skipped,\n"
    "130 stopped by Ctrl-C (128 and the signal).\n"
    "Start with:  pliant index IMAGES/ --db my.db\n"
    "             pliant query PHOTO.jpg --db my.db";

// Whether the subcommand that ran was asked for JSON: then failures are JSON as well.
bool WantsJson(const CLI::App& app) {
  for (const CLI::App* sub : app.get_subcommands()) {
    const CLI::Option* json = sub->get_option_no_throw("--json");
    if ((json != nullptr && json->count() > 0) || WantsJson(*sub)) return true;
  }
  return false;
}

// Help shows each option's default, except for empty lists and required options.
void HideEmptyDefaults(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    const std::string text = option->get_default_str();
    if (text == "[]" || text == "{}" || option->get_required()) option->default_str("");
  }
  for (CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    HideEmptyDefaults(*sub);
  }
}

void AddCommands(CLI::App& program, ExitStatus& status) {
  program.option_defaults()->always_capture_default();  // of the commands, too
  AddIndexCommand(program, status);
  AddQueryCommand(program, status);
  AddVocabCommand(program, status);
  AddDbCommand(program, status);
  AddDescribeCommand(program, status);
  AddSimulateCommand(program, status);
  AddMatchCommand(program, status);
  CLI::App* eval = program.add_subcommand("eval", "Evaluate descriptors on a data set");
  eval->require_subcommand(1);
  eval->footer("Example:  pliant eval matching scenes/");
  AddEvalMatching(*eval, status);
  AddEvalRetrieval(*eval, status);
  AddEvalTracking(*eval, status);
  AddTrackCommand(program, status);
  HideEmptyDefaults(program);
}

ExitStatus Run(int argc, char** argv) {
  CLI::App program("Find the same object again, however it is bent, folded or crumpled.", "pliant");
  program.set_version_flag("--version", std::string("pliant ") + PLIANT_VERSION);
  program.footer(kFooter);
  program.failure_message(UsageError);
  program.require_subcommand(1);
  ExitStatus status = ExitStatus::kDone;
  AddCommands(program, status);
  try {
    program.parse(argc, argv);
    FlushOutput();
    return status;
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? ExitStatus::kDone : ExitStatus::kWrongUsage;
  } catch (const Error& error) {
    ReportError(error, WantsJson(program));
    return ToExitStatus(error.code());
  } catch (const std::bad_alloc&) {
    ReportError({ErrorCode::kUnavailable, "out_of_memory", "not enough memory"},
                WantsJson(program));
  } catch (const std::exception& error) {
    ReportError({ErrorCode::kInternal, "internal", error.what()}, WantsJson(program));
  }
  return ExitStatus::kFailed;
}

}  // namespace
}  // namespace pliant::cli

int main(int argc, char** argv) {
  // A file size limit and a closed pipe cause errors of the write; they do not kill the process.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  pliant::QuietDecoders();
  const auto status = static_cast<int>(pliant::cli::Run(argc, argv));
  // After a stop by a signal the exit status is that of a process that the signal ended.
  const int number = pliant::cli::Interrupt::Signal();
  return number != 0 && status != 0 ? 128 + number : status;
}
