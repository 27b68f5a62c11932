// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <csignal>
#include <iostream>
#include <new>

#include "descriptor/image/prepare_decoders.h"
#include "index/cli/command.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/usage/usage_error.h"

namespace {

using pliant::cli::ExitStatus;

constexpr const char* kFooter =
    "Exit status: 0 done, 1 failed, 2 wrong usage, 3 done but some inputs were skipped,\n"
    "130 stopped by Ctrl-C (128 and the signal).\n"
    "Start with:  pliant index IMAGES/ --db my.db\n"
    "             pliant query PHOTO.jpg --db my.db";

// True when some subcommand that ran was asked for JSON: then failures are JSON as well.
bool WantsJson(const CLI::App& app) {
  for (const CLI::App* sub : app.get_subcommands()) {
    const CLI::Option* json = sub->get_option_no_throw("--json");
    if ((json != nullptr && json->count() > 0) || WantsJson(*sub)) return true;
  }
  return false;
}

ExitStatus Run(int argc, char** argv) {
  CLI::App program("Find the same object again, however it is bent, folded or crumpled.", "pliant");
  program.set_version_flag("--version", std::string("pliant ") + PLIANT_VERSION);
  program.footer(kFooter);
  program.failure_message(pliant::cli::UsageError);
  program.require_subcommand(1);
  ExitStatus status = ExitStatus::kDone;
  for (const auto add :
       {pliant::cli::AddIndexCommand, pliant::cli::AddQueryCommand, pliant::cli::AddVocabCommand,
        pliant::cli::AddDbCommand, pliant::cli::AddDescribeCommand, pliant::cli::AddSimulateCommand,
        pliant::cli::AddMatchCommand, pliant::cli::AddEvalCommand, pliant::cli::AddTrackCommand}) {
    add(program, status);
  }
  try {
    program.parse(argc, argv);
    pliant::cli::FlushOutput();
    return status;
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? ExitStatus::kDone : ExitStatus::kWrongUsage;
  } catch (const pliant::Error& error) {
    pliant::cli::ReportError(error, WantsJson(program));
    return pliant::cli::ToExitStatus(error.code());
  } catch (const std::bad_alloc&) {
    pliant::cli::ReportError(
        {pliant::ErrorCode::kUnavailable, "out_of_memory", "not enough memory"},
        WantsJson(program));
  } catch (const std::exception& error) {
    pliant::cli::ReportError({pliant::ErrorCode::kInternal, "internal", error.what()},
                             WantsJson(program));
  }
  return ExitStatus::kFailed;
}

}  // namespace

int main(int argc, char** argv) {
  // A file size limit and a closed pipe come as errors of the write, not as death without a word.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  pliant::QuietDecoders();
  const ExitStatus status = Run(argc, argv);
  // What was stopped by a signal ends as shells say it of those that signals end.
  const int number = pliant::cli::Interrupt::Signal();
  return number != 0 && status != ExitStatus::kDone ? 128 + number : static_cast<int>(status);
}
