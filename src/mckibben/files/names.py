"""Words for channels, references and commands in headers, in ten languages. Data only.

Words are in lower case, several of one name joined by underscores; a header matches whole words.
"""

from __future__ import annotations

CHANNELS: dict[str, dict[str, str]] = {
    "time": {
        "en": "t time timestamp time_stamp datetime elapsed elapsed_time millis micros",
        "de": "zeit zeitstempel uhrzeit",
        "fr": "temps horodatage heure", "it": "tempo ora", "pt": "tempo", "es": "tiempo hora",
        "ja": "時間 時刻 経過時間", "zh": "时间 时刻 時間", "ko": "시간 시각"},
    "pressure": {
        "en": "p press pressure", "de": "druck", "fr": "pression", "it": "pressione",
        "es": "presión presion", "pt": "pressão pressao", "ja": "圧力 圧 空気圧 空気圧力",
        "zh": "压力 压强 气压 壓力", "ko": "압력 공기압"},
    "voltage": {
        "en": "u voltage valve_voltage command_voltage", "de": "spannung ventilspannung",
        "fr": "voltage tension_électrique", "it": "tensione", "es": "tensión voltaje",
        "pt": "tensão tensao voltagem", "ja": "電圧", "zh": "电压 電壓", "ko": "전압"},
    "displacement": {
        "en": "disp displacement pos position stroke shortening",
        "de": "weg hub verschiebung auslenkung", "fr": "déplacement deplacement course position",
        "it": "spostamento corsa posizione", "es": "desplazamiento posición posicion carrera",
        "pt": "deslocamento posição posicao curso", "ja": "変位 変位量 位置 ストローク 収縮量",
        "zh": "位移 位移量 变形量 变形 位置 行程 收缩量", "ko": "변위 위치 스트로크 수축량"},
    "length": {
        "en": "l length", "de": "länge laenge", "fr": "longueur", "it": "lunghezza",
        "es": "longitud", "pt": "comprimento", "ja": "長さ 全長", "zh": "长度 長度", "ko": "길이"},
    "contraction": {
        "en": "contraction contraction_ratio", "de": "kontraktion",
        "fr": "contraction taux_de_contraction", "it": "contrazione",
        "es": "contracción contraccion", "pt": "contração contracao", "ja": "収縮率",
        "zh": "收缩率", "ko": "수축률"},
    "force": {
        "en": "f force load", "de": "kraft zugkraft", "fr": "force", "it": "forza carico",
        "es": "fuerza carga", "pt": "força forca carga", "ja": "力 荷重 張力 推力",
        "zh": "力 力值 拉力 推力 载荷", "ko": "힘 하중 장력"},
    "torque": {
        "en": "torque", "de": "drehmoment", "fr": "couple", "it": "coppia", "es": "par_motor",
        "pt": "binário", "ja": "トルク", "zh": "扭矩 转矩", "ko": "토크"},
    "velocity": {
        "en": "velocity vel speed", "de": "geschwindigkeit", "fr": "vitesse",
        "it": "velocità velocita", "es": "velocidad", "pt": "velocidade", "ja zh": "速度",
        "ko": "속도"},
    "angle": {
        "en": "angle theta", "de": "winkel", "fr": "angle", "it": "angolo", "es": "ángulo angulo",
        "pt": "ângulo angulo", "ja": "角度 角 関節角度", "zh": "角度 转角", "ko": "각도"},
    "temperature": {
        "en": "temperature temp", "de": "temperatur", "fr": "température temperature",
        "it es pt": "temperatura", "ja": "温度", "zh": "温度 溫度", "ko": "온도"},
}  # fmt: skip
"""Standard channel -> language -> the words for it."""

ROLES: dict[str, dict[str, str]] = {
    "reference": {
        "en": "reference ref setpoint desired target", "de": "sollwert soll",
        "fr": "consigne référence", "it": "riferimento", "es": "referencia consigna objetivo",
        "pt": "referência referencia alvo", "ja": "目標 目標値 設定 設定値",
        "zh": "目标 目标值 设定 设定值 期望 给定", "ko": "목표 목표값 설정"},
    "command": {
        "en": "command commanded cmd", "de": "stellgröße stellgroesse", "fr": "commande",
        "it es pt": "comando", "ja zh": "指令 指令値 指令值", "ko": "명령 지령"},
}  # fmt: skip
"""References and commands of a loop -> words for them, used with or instead of a channel's name."""


def words_of(table: dict[str, dict[str, str]]) -> dict[str, str]:
    """Return the meaning of each word of a table.

    >>> words_of(CHANNELS)["druck"]
    'pressure'
    """
    return {
        word: meaning
        for meaning, languages in table.items()
        for words in languages.values()
        for word in words.split()
    }
