# cmake -DBUILD=<build folder> -DSOURCE=<source folder> -DCXX=<compiler> -P install_test.cmake
# Installs into a folder of its own, looks at what is there, and builds and runs a program outside the tree against it.
set(work ${BUILD}/install_test)
set(prefix ${work}/usr)
file(REMOVE_RECURSE ${work})

function(must_run what)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE out ERROR_VARIABLE out)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "${what} failed (${code}):\n${out}")
  endif()
  set(output "${out}" PARENT_SCOPE)
endfunction()

must_run("cmake --install" ${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})

foreach(file IN ITEMS bin/eigenpose bin/eigenposed include/eigenpose/core/recognition/recognizer.h
        lib/systemd/system/eigenposed.service lib/sysusers.d/eigenpose.conf lib/udev/rules.d/60-eigenpose.rules
        lib/tmpfiles.d/eigenpose.conf
        share/doc/eigenpose/copyright share/doc/eigenpose/eigenposed.toml share/doc/eigenpose/rigs/simulated.toml
        share/man/man1/eigenpose.1 share/man/man8/eigenposed.8
        etc/eigenpose/eigenposed.toml etc/eigenpose/profiles/oriental_motor_az.toml)
  if(NOT EXISTS ${prefix}/${file})
    message(FATAL_ERROR "not installed: ${file}")
  endif()
endforeach()

# What the lab changed stays when the program is installed again.
set(settings ${prefix}/etc/eigenpose/eigenposed.toml)
file(WRITE ${settings} "# changed by the lab\n")
must_run("the second cmake --install" ${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
file(READ ${settings} text)
if(NOT text STREQUAL "# changed by the lab\n")
  message(FATAL_ERROR "the lab's settings were overwritten")
endif()

file(READ ${prefix}/lib/systemd/system/eigenposed.service unit)
if(NOT unit MATCHES "ExecStart=${prefix}/bin/eigenposed --config ${settings}\n")
  message(FATAL_ERROR "the unit does not start the installed program:\n${unit}")
endif()

# Every command stands in the manual page, with every option.
must_run("eigenpose --help" ${prefix}/bin/eigenpose --help)
file(READ ${prefix}/share/man/man1/eigenpose.1 manual)
string(REGEX MATCHALL "\n  [a-z]+  " commands "${output}")
list(LENGTH commands count)
if(count LESS 10)
  message(FATAL_ERROR "--help lists only ${count} commands")
endif()
foreach(command IN LISTS commands)
  string(STRIP "${command}" command)
  if(NOT manual MATCHES "\n.SS eigenpose ${command}\n")
    message(FATAL_ERROR "the manual page lacks the command '${command}'")
  endif()
endforeach()

must_run("configuring the outside program" ${CMAKE_COMMAND} -G Ninja -S ${SOURCE}/tests/install/outside -B ${work}/outside
         -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER})
must_run("building the outside program" ${CMAKE_COMMAND} --build ${work}/outside)
file(MAKE_DIRECTORY ${work}/sets)
must_run("running the outside program" ${work}/outside/outside ${work}/sets)
if(NOT output MATCHES "^stout 12[3-7]\n$")
  message(FATAL_ERROR "the outside program said: ${output}")
endif()
