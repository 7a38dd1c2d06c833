# Builds the viewer with Vite and writes OUTPUT: C++ that holds the files, for server/net/viewer_files.h. Where Node.js or
# the packages are missing, one page stands for all that says so: the C++ build needs neither.
#   SOURCE: client/web   FOLDER: where Vite writes   OUTPUT: the C++ file   NODE: the program, or empty
set(vite ${SOURCE}/node_modules/vite/bin/vite.js)
file(REMOVE_RECURSE ${FOLDER})
file(MAKE_DIRECTORY ${FOLDER})
if(NOT NODE)
  set(missing "Node.js was not found when the server was built")
elseif(NOT EXISTS ${vite})
  set(missing "its npm packages were missing when the server was built")
endif()

if(missing)
  message("-- The live viewer is left out: ${missing} (./dev build fetches what is needed)")
  file(WRITE ${FOLDER}/index.html "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>radiosityd</title>\n"
    "<h1>The viewer was not built</h1>\n<p>${missing}. Install <code>nodejs</code> and <code>npm</code>, then run "
    "<code>./dev build</code>.</p>\n<p>Everything else works: see the <a href=\"/status\">status page</a>.</p>\n</html>\n")
else()
  execute_process(COMMAND ${CMAKE_COMMAND} -E env RADIOSITY_WEB_OUT=${FOLDER} ${NODE} ${vite} build --logLevel warn
    WORKING_DIRECTORY ${SOURCE} RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "vite build failed")
  endif()
endif()

set(types html "text/html; charset=utf-8" js "text/javascript; charset=utf-8" css "text/css; charset=utf-8"
  svg "image/svg+xml" json "application/json" wasm "application/wasm")
file(GLOB_RECURSE files RELATIVE ${FOLDER} ${FOLDER}/*)
list(FILTER files EXCLUDE REGEX "\\.gz$")
list(SORT files)
set(bytes "")
set(table "")
set(number 0)

# Assembler that puts a file's bytes between two symbols. Its hash is there so that the compiler runs when they change.
function(embed symbol path)
  file(SHA256 ${path} hash)
  string(APPEND bytes "// ${hash}\n__asm__(\".section .rodata\\n${symbol}:\\n.incbin \\\"${path}\\\"\\n${symbol}_end:\\n.byte 0\\n.previous\\n\");\n"
    "extern \"C\" const char ${symbol}[], ${symbol}_end[];\n")
  set(bytes "${bytes}" PARENT_SCOPE)
endfunction()

foreach(file IN LISTS files)
  set(symbol viewer_file_${number})
  math(EXPR number "${number} + 1")
  get_filename_component(extension ${file} LAST_EXT)
  string(SUBSTRING ${extension} 1 -1 extension)
  list(FIND types ${extension} at)
  if(at LESS 0)
    message(FATAL_ERROR "no content type is known for ${file}")
  endif()
  math(EXPR at "${at} + 1")
  list(GET types ${at} type)
  embed(${symbol} ${FOLDER}/${file})
  set(packed "{}")
  if(EXISTS ${FOLDER}/${file}.gz)
    embed(${symbol}_gz ${FOLDER}/${file}.gz)
    set(packed "text(${symbol}_gz, ${symbol}_gz_end)")
  endif()
  file(SHA256 ${FOLDER}/${file} hash)
  string(SUBSTRING ${hash} 0 20 tag)
  string(APPEND table "      {\"/${file}\", \"${type}\", text(${symbol}, ${symbol}_end), ${packed}, \"\\\"${tag}\\\"\"},\n")
endforeach()

file(WRITE ${OUTPUT} "// Written by client/web/build_viewer.cmake.\n#include \"server/net/viewer_files.h\"\n\n${bytes}\n"
  "namespace radiosity::net {\nnamespace {\n\nstd::string_view text(const char* first, const char* last) {\n"
  "  return {first, static_cast<std::size_t>(last - first)};\n}\n\n}  // namespace\n\n"
  "std::span<const ViewerFile> viewerFiles() {\n  static const ViewerFile kFiles[] = {\n${table}  };\n  return kFiles;\n}\n\n"
  "}  // namespace radiosity::net\n")
