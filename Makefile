# Everything runs in .venv, which each target sets up as far as it needs. A stamp .venv/extension says that the extension
# was built from the present sources, and .venv/with-GROUP that the dependency group GROUP is installed beside it.

PYTHON ?= python3
BIN := .venv/bin
TARGET := $(or $(CARGO_TARGET_DIR),target)
VERSION := $(shell sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml)
# Version of the C ABI, as in the library's SONAME: a program looks for libpdmp.so.$(ABI) when it runs.
ABI := $(shell echo $(VERSION) | cut -d. -f1,2)
# File of the shared library, its SONAME, and the name with which programs are linked.
LIBRARY := $(if $(filter Darwin,$(shell uname)),libpdmp.$(VERSION).dylib libpdmp.$(ABI).dylib libpdmp.dylib,\
	libpdmp.so.$(VERSION) libpdmp.so.$(ABI) libpdmp.so)
# Folder into which `make install` puts the C and C++ libraries; DESTDIR is put in front of it.
prefix ?= /usr/local
INSTALLED = $(DESTDIR)$(prefix)
FILL = sed -e 's/@version@/$(VERSION)/; s/@abi@/$(ABI)/g; s/@library@/$(firstword $(LIBRARY))/; s/@soname@/$(word 2,$(LIBRARY))/'
SOURCES := pyproject.toml Cargo.toml Cargo.lock $(shell find crates -name '*.rs' -o -name Cargo.toml)

# The bindings are compiled against the interpreter that will import them.
export PYO3_PYTHON := $(CURDIR)/$(BIN)/python

# The robot's model is read from a wheel whose dependencies are not needed.
ROBOT := robosuite==1.5.2
# Recordings of people walking, for Fig. 5, if PDMP_DATA names a folder of recordings that has them.
WALKS := $(if $(PDMP_DATA),$(wildcard $(PDMP_DATA)/walk_styles_bandai/demos))

# Seconds of `make fuzz` for each target.
TIME ?= 60
HOST = $(shell rustc -vV | sed -n 's/^host: //p')
# Coverage for libFuzzer, with the flags of cargo-fuzz, and AddressSanitizer, which the stable compiler hides.
COVERAGE := -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
	-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
	-Cllvm-args=-sanitizer-coverage-trace-compares
SANITIZED := RUSTC_BOOTSTRAP=1 RUSTFLAGS='-Zsanitizer=address

.PHONY: demo reproduce test check bench bench-peers bench-controllers bench-scaling bench-streaming bench-bases bench-transport bench-robots bench-poses report rtsan fuzz asan licences capi install packages header stubs \
	docs clean needs

demo: .venv/with-demo  ## Learns human handwriting and writes model, figures and a table to out/demo/
	$(BIN)/python -m reproduction.demo -o out/demo

reproduce: .venv/with-reproduction  ## The paper's figures, on a simulated robot, into out/reproduction/
	$(BIN)/python -m reproduction all -o out/reproduction $(if $(WALKS),--recordings $(WALKS))

test: .venv/with-test  ## Runs every test, Rust and Python
	cargo test --profile tests --workspace
	cargo test --profile tests --package pdmp-core --no-default-features --test runtime
	$(BIN)/pytest

check: .venv/with-dev  ## Formatting, lints, links in the documentation, types, stubs against the module, prose, and licences
	cargo fmt --all --check
	cargo clippy --release --workspace --all-targets -- -D warnings
	cargo clippy --release --package pdmp-core --no-default-features -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --release --no-deps --package pdmp-core
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/stubtest pdmp._native
	$(BIN)/python .ci/stubs.py
	$(PYTHON) .ci/prose.py
	$(PYTHON) .ci/licences.py
	$(PYTHON) .ci/runtime.py
	$(BIN)/zizmor --offline --quiet .github

bench: | needs  ## Times, latencies and instructions of the core
	cargo bench --package pdmp-benches

bench-peers: .venv/with-peers  ## The same work done by pdmp and by its peers, one thread each
	OMP_NUM_THREADS=1 PYTHONPATH=benches $(BIN)/python -m peers

bench-controllers: .venv/with-demo  ## A tick of 4096 movements in Python: together, one by one, and by plain numpy and torch
	OMP_NUM_THREADS=1 $(BIN)/python benches/controllers.py

bench-scaling: .venv/with-peers  ## Draws how the time to learn grows with the data, into docs/scaling.png
	OMP_NUM_THREADS=1 $(BIN)/python benches/scaling.py

bench-streaming: .venv/with-peers  ## Fits of a thousand to a hundred thousand demonstrations in blocks, and their memory, into docs/streaming.png
	OMP_NUM_THREADS=1 $(BIN)/python benches/streaming.py

bench-bases: .venv/with-demo  ## How well each basis reproduces and predicts the recordings in PDMP_DATA
	OMP_NUM_THREADS=1 $(BIN)/python benches/bases.py

bench-transport: .venv/with-demo  ## Transport to other goals and the end of movements, on the recordings in PDMP_DATA
	OMP_NUM_THREADS=1 PYTHONPATH=benches $(BIN)/python -m transport

bench-robots: .venv/with-reproduction  ## Simulated robots under random commands within their limits, on the recordings in PDMP_DATA
	OMP_NUM_THREADS=1 PYTHONPATH=benches $(BIN)/python -m robots

bench-poses: .venv/with-reproduction  ## A recorded tool path on a Panda, and a box between the arms of a Baxter, with PDMP_DATA
	OMP_NUM_THREADS=1 PYTHONPATH=benches $(BIN)/python -m poses

report: .venv/with-test  ## Errors of predictions from contexts, from points and from half a movement, on the recordings in PDMP_DATA; figures into out/report/
	OMP_NUM_THREADS=1 PYTHONPATH=benches $(BIN)/python -m report
	OMP_NUM_THREADS=1 PYTHONPATH=benches $(BIN)/python -m report.via_points
	OMP_NUM_THREADS=1 PYTHONPATH=benches $(BIN)/python -m report.recognition

# The sanitizer may not touch build scripts, which a named target spares. A compiler without it says why.
rtsan: | needs  ## Runs the control loop under the real-time sanitizer of a nightly compiler, where there is one
	@mkdir -p target/rtsan
	@if ! reason=$$(echo 'fn main() {}' | rustup run nightly rustc -Zsanitizer=realtime -o target/rtsan/probe - 2>&1); \
	then echo "skipped, as there is no nightly compiler with the real-time sanitizer: $$reason"; \
	else RUSTFLAGS='-Zsanitizer=realtime --cfg rtsan' rustup run nightly cargo test --release --package pdmp-core \
		--test realtime --target "$$(rustc -vV | sed -n 's/^host: //p')" --target-dir target/rtsan; \
	fi

fuzz: .venv/with-test  ## Searches each border for inputs that break its claim, TIME=60 seconds each; those found into fuzz/found/
	$(SANITIZED) --cfg fuzzing $(COVERAGE)' cargo build --release --manifest-path fuzz/Cargo.toml --locked \
		--target $(HOST) --target-dir target/fuzz
	@status=0; for target in model_file c_abi; do \
		mkdir -p fuzz/found/$$target; \
		target/fuzz/$(HOST)/release/$$target -max_total_time=$(TIME) -max_len=512 -timeout=10 -rss_limit_mb=2048 \
			-verbosity=0 -print_final_stats=1 -artifact_prefix=fuzz/found/$$target/ \
			fuzz/found/$$target fuzz/corpus/$$target || status=1; \
	done; \
	$(BIN)/python fuzz/readers.py --seconds $(TIME) --found fuzz/found || status=1; exit $$status

asan: | needs  ## Runs the tests of the C ABI under AddressSanitizer
	$(SANITIZED)' cargo test --release --package pdmp-capi --lib --test refusals --test corpus \
		--target $(HOST) --target-dir target/asan

licences: | needs  ## Collects the licences of the linked crates into LICENSE-THIRD-PARTY, which the wheel holds
	$(PYTHON) .ci/licences.py --write

capi:  ## Builds the libraries for C and C++ and installs them into dist/capi/
	@$(MAKE) --no-print-directory install prefix=$(CURDIR)/dist/capi DESTDIR=

install: | needs  ## Installs the libraries for C and C++, headers, and files for pkg-config and CMake into prefix=/usr/local
	cargo build --release --package pdmp-capi
	mkdir -p $(addprefix $(INSTALLED)/,include lib/pkgconfig lib/cmake/pdmp share/licenses/pdmp)
	install -m 644 crates/pdmp-capi/include/pdmp.h crates/pdmp-capi/include/pdmp.hpp $(INSTALLED)/include
	install -m 644 $(TARGET)/release/libpdmp.a $(INSTALLED)/lib
	install -m 755 $(TARGET)/release/$(lastword $(LIBRARY)) $(INSTALLED)/lib/$(firstword $(LIBRARY))
	ln -sf $(firstword $(LIBRARY)) $(INSTALLED)/lib/$(word 2,$(LIBRARY))
	ln -sf $(word 2,$(LIBRARY)) $(INSTALLED)/lib/$(lastword $(LIBRARY))
	$(FILL) crates/pdmp-capi/package/pdmp.pc.in > $(INSTALLED)/lib/pkgconfig/pdmp.pc
	for name in pdmp-config pdmp-config-version; do \
		$(FILL) crates/pdmp-capi/package/$$name.cmake.in > $(INSTALLED)/lib/cmake/pdmp/$$name.cmake || exit 1; \
	done
	install -m 644 LICENSE* $(INSTALLED)/share/licenses/pdmp

packages: .venv/with-packages  ## Builds wheel, source distribution and crate, checks them, and puts those for pip into dist/python/
	rm -rf dist/python
	$(BIN)/maturin build --quiet --release --out dist/python
	$(BIN)/python .ci/recompress.py dist/python
	$(BIN)/maturin sdist --out dist/python
	$(BIN)/python .ci/packages.py

header: | needs  ## Writes pdmp.h from the sources of the C ABI
	PDMP_WRITE_HEADER=1 cargo test --release --package pdmp-capi --test header

stubs: .venv/with-dev  ## Copies the docstrings of the compiled module into its stub
	$(BIN)/python .ci/stubs.py --write

docs: .venv/with-docs  ## The documentation site, with its snippets and examples executed, into out/docs/index.html
	RUSTDOCFLAGS='-D warnings' cargo doc --release --no-deps --package pdmp-core
	$(BIN)/sphinx-build --fresh-env --fail-on-warning --keep-going --quiet --nitpicky -b html docs out/docs
	rm -rf out/docs/rust && cp -r $(TARGET)/doc out/docs/rust

clean:  ## Removes what the targets above made
	cargo clean
	rm -rf .venv out dist docs/_generated fuzz/found python/pdmp/_native*.so

.venv/with-%: .venv/extension
	@$(BIN)/python .ci/requirements.py $* > .venv/requirements-$*.txt
	$(BIN)/pip install --quiet --no-warn-conflicts --requirement .venv/requirements-$*.txt
	$(if $(filter reproduction test dev,$*),$(BIN)/pip install --quiet --no-deps $(ROBOT))
	@touch $@

.venv/extension: $(SOURCES) | $(BIN)/python
	@echo 'building the extension: some minutes the first time'
	$(BIN)/pip install --quiet --editable .
	@touch $@

$(BIN)/python: | needs
	$(PYTHON) -m venv .venv

needs:
	@command -v cargo >/dev/null \
		|| { echo 'missing: cargo (Rust 1.89 or newer): install it with rustup'; exit 1; }
	@$(PYTHON) -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
		|| { echo 'missing: Python 3.11 or newer with venv: install it, or name it: make PYTHON=python3.12'; exit 1; }
