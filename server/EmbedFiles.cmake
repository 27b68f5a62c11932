# Writes OUT, a C++ file that holds the web page. Run as
#   cmake -DWEB=<folder> -DOUT=<file> -P EmbedFiles.cmake
# Each entry: file|path it is served at|media type; all are UTF-8
set(assets
    "index.html|/|text/html"
    "app.css|/assets/app.css|text/css"
    "app.js|/assets/app.js|text/javascript"
    "results.js|/assets/results.js|text/javascript"
    "api.js|/assets/api.js|text/javascript")

set(arrays "")
set(table "")
set(number 0)
foreach(asset IN LISTS assets)
  string(REPLACE "|" ";" parts "${asset}")
  list(GET parts 0 name)
  list(GET parts 1 path)
  list(GET parts 2 type)
  file(READ "${WEB}/${name}" hex HEX)
  string(LENGTH "${hex}" length)
  math(EXPR bytes "${length} / 2")
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "'\\\\x\\1'," values "${hex}")
  string(APPEND arrays "const char kFile${number}[] = {${values}};\n")
  string(APPEND table "    {\"${path}\", \"${type}; charset=utf-8\", kFile${number}, ${bytes}},\n")
  math(EXPR number "${number} + 1")
endforeach()

file(
  WRITE "${OUT}"
  "// Made by EmbedFiles.cmake.\n#include \"server/web_assets.h\"\n\n"
  "namespace pliant::server {\nnamespace {\n${arrays}\n"
  "const WebAsset kAssets[] = {\n${table}};\n}  // namespace\n\n"
  "std::span<const WebAsset> WebAssets() { return kAssets; }\n}  // namespace pliant::server\n")
