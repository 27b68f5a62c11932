# Writes OUT, a C++ file that holds the web page. Run as
#   cmake -DWEB=<folder> -DOUT=<file> -DFILES=<names> -P EmbedFiles.cmake
# FILES: names in the folder, separated by commas. index.html is served at /, NAME.html at /NAME, the others at
# /assets/NAME; texts are UTF-8.
string(REPLACE "," ";" names "${FILES}")
set(type_html "text/html; charset=utf-8")
set(type_css "text/css; charset=utf-8")
set(type_js "text/javascript; charset=utf-8")
set(type_json application/json)
set(type_jpg image/jpeg)

set(arrays "")
set(table "")
set(number 0)
foreach(name IN LISTS names)
  set(path "/assets/${name}")
  if(name STREQUAL "index.html")
    set(path "/")
  elseif(name MATCHES "^(.*)\\.html$")
    set(path "/${CMAKE_MATCH_1}")
  endif()
  string(REGEX REPLACE ".*\\." "" suffix "${name}")
  set(type "${type_${suffix}}")
  file(SHA256 "${WEB}/${name}" hash)
  file(READ "${WEB}/${name}" hex HEX)
  string(LENGTH "${hex}" length)
  math(EXPR bytes "${length} / 2")
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "\\\\x\\1" values "${hex}")
  string(APPEND arrays "const char kFile${number}[] = \"${values}\";\n")
  string(APPEND table "    {\"${path}\", \"${type}\", kFile${number}, ${bytes}, \"${hash}\"},\n")
  math(EXPR number "${number} + 1")
endforeach()

file(
  WRITE "${OUT}"
  "// Made by EmbedFiles.cmake.\n#include \"server/web/web_assets.h\"\n\n"
  "namespace pliant::server {\nnamespace {\n${arrays}\n"
  "const WebAsset kAssets[] = {\n${table}};\n}  // namespace\n\n"
  "std::span<const WebAsset> WebAssets() { return kAssets; }\n}  // namespace pliant::server\n")
