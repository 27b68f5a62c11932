// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Text as a QR code: the page shows one for a link with a key, which a phone then scans.
#include <memory>

#include <fmt/format.h>
#include <qrencode.h>

#include "descriptor/base/error.h"
#include "server/routes/routes.h"

namespace pliant::server {
namespace {

constexpr std::size_t kMostTextBytes = 512;  // 97 modules a side: phones still read it
constexpr int kQuietModules = 4;             // the margin that ISO/IEC 18004 asks for

// Dark on light with a margin, whatever is around it. One unit is one module.
std::string Drawing(const QRcode& code) {
  const int side = code.width + 2 * kQuietModules;
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {0}\" "
      "shape-rendering=\"crispEdges\"><path fill=\"#fff\" d=\"M0 0h{0}v{0}H0z\"/><path d=\"",
      side);
  for (int y = 0; y < code.width; ++y) {
    for (int x = 0; x < code.width; ++x) {
      if ((code.data[y * code.width + x] & 1) == 0) continue;  // the other bits say what it is for
      svg += fmt::format("M{} {}h1v1h-1z", x + kQuietModules, y + kQuietModules);
    }
  }
  return svg + "\"/></svg>";
}

Response Draw(Service&, const Request&, const Parameters& parameters) {
  const std::string text = parameters.Text("text").value_or("");
  if (text.size() > kMostTextBytes) {
    ThrowInvalid("text", fmt::format("text has {} bytes. A QR code takes up to {} here.",
                                     text.size(), kMostTextBytes));
  }
  const std::unique_ptr<QRcode, decltype(&QRcode_free)> code(
      QRcode_encodeData(static_cast<int>(text.size()),
                        reinterpret_cast<const unsigned char*>(text.data()), 0, QR_ECLEVEL_M),
      &QRcode_free);
  if (!code) throw Error(ErrorCode::kInternal, "qr_code", "The QR code cannot be made.");
  return {.content_type = "image/svg+xml",
          .body = Drawing(*code),
          .headers = {{"Cache-Control", "no-store"}}};
}

}  // namespace

void AddQrRoutes(RouteTable& table) {
  table.Add("POST /v1/qr", "qr", Draw)
      .Summary("Get text, such as a link, as a QR code. The server stores and logs nothing of it")
      .Needs(Scope::kRead)
      .Takes({Parameter("text", "what the code says, up to 512 bytes").Required()})
      .Sends("image/svg+xml", "the code, dark on light, with its margin")
      .WithoutIndex()
      .Example(
          R"(-H "Content-Type: application/json" -d '{"text": "https://example.org"}' -o qr.svg)");
}

}  // namespace pliant::server
