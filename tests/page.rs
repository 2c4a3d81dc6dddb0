//! The demo's page in a headless browser. Skipped, with a word, where there is no Chromium.

use std::{
    error::Error,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

type Tried<T> = Result<T, Box<dyn Error>>;

/// What a person does, done by a script: all canvases must hold a picture, and a control must change it.
const PROBE: &str = r#"<script>
(() => {
  const count = (canvas) => {
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const drawn = copy.getContext("2d");
    drawn.drawImage(canvas, 0, 0);
    const pixels = drawn.getImageData(0, 0, copy.width, copy.height).data;
    let sum = 0, coloured = 0;
    for (let i = 0; i < pixels.length; i += 4) {
      sum = (sum * 31 + pixels[i] + 3 * pixels[i + 1] + 7 * pixels[i + 2]) % 1000000007;
      coloured += pixels[i] + pixels[i + 1] + pixels[i + 2] < 740;
    }
    return { sum, share: coloured / (copy.width * copy.height) };
  };
  const results = [];
  const say = (what, ok) => results.push(`${what}:${ok ? "yes" : "NO"}`);
  window.addEventListener("load", () => setTimeout(() => {
    say("ready", document.body.dataset.ready === "yes");
    const figures = [...document.querySelectorAll(".scene")];
    say("scenes", figures.length === 3);
    for (const figure of figures) {
      const canvas = figure.querySelector("canvas");
      const before = count(canvas);
      say(`drawn ${before.share.toFixed(2)}`, before.share > 0.05);
      const box = figure.querySelector("input[type=checkbox]");
      box.click();
      say("a control changes the picture", count(canvas).sum !== before.sum);
      box.click();
      say("and back", count(canvas).sum === before.sum);
      canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true }));
      say("a key turns it", count(canvas).sum !== before.sum);
    }
    const select = document.querySelector("select[data-colour]");
    const canvas = select.closest(".scene").querySelector("canvas");
    const before = count(canvas);
    select.value = "curvature";
    select.dispatchEvent(new Event("change"));
    say("colours change", count(canvas).sum !== before.sum);
    say("no sideways scrolling", document.documentElement.scrollWidth <= window.innerWidth + 1);
    say("downloads", [...document.querySelectorAll("a[data-table]")].every((a) => a.href.startsWith("blob:")));
    document.title = "probe " + results.join(", ");
  }, 300));
})();
</script></body>"#;

/// The demo, made once, and a second time with another number of threads.
fn demo(home: &Path, name: &str, jobs: &str) -> Tried<PathBuf> {
    let out = home.join(name);
    let run =
        Command::new(env!("CARGO_BIN_EXE_combwright")).args(["demo", "-j", jobs, "-o"]).arg(&out).output()?;
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    Ok(out)
}

fn chromium(page: &Path, arguments: &[String], home: &Path) -> Option<Output> {
    let program = ["chromium", "chromium-browser", "google-chrome"].into_iter().find(|name| {
        Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
    })?;
    Command::new(program)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu-sandbox",
            "--use-gl=angle",
            "--use-angle=swiftshader",
        ])
        .args(["--enable-unsafe-swiftshader", "--enable-logging=stderr", "--hide-scrollbars"])
        .arg(format!("--user-data-dir={}", home.join("profile").display()))
        .args(arguments)
        .arg(format!("file://{}", page.display()))
        .output()
        .ok()
}

#[test]
fn the_demo_is_the_same_for_any_number_of_threads_and_its_page_works() -> Tried<()> {
    let home = tempfile::tempdir()?;
    let out = demo(home.path(), "one", "1")?;
    let again = demo(home.path(), "two", "2")?;
    for name in
        ["report.html", "foam/pattern.json", "comb/view-3/photo.png", "compare/comparison.json", "README.txt"]
    {
        assert!(fs::read(out.join(name))? == fs::read(again.join(name))?, "{name} differs");
    }
    let html = fs::read_to_string(out.join("report.html"))?;
    assert!(html.len() < 8_000_000, "{} bytes", html.len());
    for address in ["src=\"http", "href=\"http", "url(http", "src=\"//"] {
        assert!(!html.contains(address), "the page loads something from elsewhere: {address}");
    }
    let probed = out.join("probed.html");
    fs::write(&probed, html.replacen("</body>", PROBE, 1))?;
    for width in [1280, 390] {
        let arguments =
            [format!("--window-size={width},900"), "--virtual-time-budget=20000".into(), "--dump-dom".into()];
        let Some(run) = chromium(&probed, &arguments, home.path()) else {
            println!("skipped: no Chromium here to open the page in");
            return Ok(());
        };
        let page = String::from_utf8_lossy(&run.stdout);
        let title = page.split("<title>").nth(1).and_then(|t| t.split("</title>").next()).unwrap_or_default();
        assert!(title.starts_with("probe"), "{width}: the page did not run: {title}");
        assert!(!title.contains("NO"), "{width}: {title}");
        let log = String::from_utf8_lossy(&run.stderr);
        let errors: Vec<&str> =
            log.lines().filter(|line| line.contains("CONSOLE") && !line.contains("GPU stall")).collect();
        assert!(errors.is_empty(), "{width}: {errors:?}");
    }
    Ok(())
}

#[test]
fn view_names_the_page_or_says_what_is_missing() -> Tried<()> {
    let home = tempfile::tempdir()?;
    let run = |folder: &Path| {
        Command::new(env!("CARGO_BIN_EXE_combwright")).args(["view", "--no-open"]).arg(folder).output()
    };
    let missing = run(home.path())?;
    assert_eq!(missing.status.code(), Some(2));
    assert!(String::from_utf8(missing.stderr)?.contains("combwright demo"));
    fs::write(home.path().join("report.html"), "<!doctype html>")?;
    let found = run(home.path())?;
    assert!(found.status.success());
    assert!(String::from_utf8(found.stdout)?.trim().ends_with("report.html"));
    Ok(())
}
