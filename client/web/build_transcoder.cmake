# Bundles the script that turns KTX2 into PNG, and writes OUTPUT: C++ that holds it and the transcoder of Basis Universal,
# for client/cli/transcoder_files.h. Where Node.js or the packages are missing, all are empty.
#   SOURCE: client/web   FOLDER: where Vite writes   OUTPUT: the C++ file   NODE: the program, or empty
set(vite ${SOURCE}/node_modules/vite/bin/vite.js)
set(basis ${SOURCE}/node_modules/three/examples/jsm/libs/basis)
set(files "")
if(NODE AND EXISTS ${vite})
  execute_process(COMMAND ${CMAKE_COMMAND} -E env RADIOSITY_WEB_OUT=${FOLDER} ${NODE} ${vite} build
      --config vite.transcoder.config.ts --logLevel warn
    WORKING_DIRECTORY ${SOURCE} RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "vite build of the transcoder's script failed")
  endif()
  set(files ${FOLDER}/transcode.mjs ${basis}/basis_transcoder.js ${basis}/basis_transcoder.wasm)
endif()

set(bytes "")
set(texts "")
set(number 0)
foreach(path IN LISTS files)
  file(SHA256 ${path} hash)  # so that the compiler runs when they change
  set(symbol transcoder_file_${number})
  math(EXPR number "${number} + 1")
  string(APPEND bytes "// ${hash}\n__asm__(\".section .rodata\\n${symbol}:\\n.incbin \\\"${path}\\\"\\n${symbol}_end:\\n.byte 0\\n.previous\\n\");\n"
    "extern \"C\" const char ${symbol}[], ${symbol}_end[];\n")
  list(APPEND texts "{${symbol}, static_cast<std::size_t>(${symbol}_end - ${symbol})}")
endforeach()
list(JOIN texts ", " texts)
file(WRITE ${OUTPUT} "// Written by client/web/build_transcoder.cmake.\n#include \"client/cli/transcoder_files.h\"\n\n${bytes}\n"
  "namespace radiosity::cli {\n\nTranscoderFiles transcoderFiles() { return {${texts}}; }\n\n}  // namespace radiosity::cli\n")
